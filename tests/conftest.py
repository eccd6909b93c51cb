"""What all tests share."""

from hypothesis import settings

# the first example may compile a kernel, and the machine may be busy: time limits are no property of the code
settings.register_profile("suite", deadline=None)
settings.load_profile("suite")
