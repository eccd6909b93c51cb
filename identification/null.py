"""How much evidence a cause must have before it is asserted: one number, from flights on which nothing is wrong.

Log Bayes factors of the best of all causes over none, on flights whose every parameter is a draw from what the vehicle
file declares, have an exponential tail; the threshold stands where that tail has fallen to the family-wise rate.
"""

THRESHOLD = 10.0  # [nats] for a cause, over the best explanation without it
CLASS_MARGIN = 3.0  # [nats] within which the data do not tell two causes apart
ALIKE = 0.95  # cosine of two signatures, from which on they are one class
HOPELESS = 3.0  # d' below which a cause cannot be seen on these flights
