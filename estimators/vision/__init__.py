"""Front ends: a picture and what is known beforehand in, a sighting with its covariance out."""
