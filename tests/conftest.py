"""What all tests share."""

import signal

from hypothesis import settings

# the first example may compile a kernel, and the machine may be busy: time limits are no property of the code
settings.register_profile("suite", deadline=None)
settings.load_profile("suite")

# a suite started in the background inherits an ignored Ctrl-C, and would hand that on to the programs that it starts
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
