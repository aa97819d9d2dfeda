"""What holds for all tests."""

import signal

# A shell that starts the tests behind its back (&) has them ignore interrupts, and all programs they start, too.
signal.signal(signal.SIGINT, signal.default_int_handler)
