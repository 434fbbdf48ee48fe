"""The vocabulary that all rooms share: settings, pulse, frame, tag, clocks, status, errors, topics, transport."""
