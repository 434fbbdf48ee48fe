"""What the tests of all rooms share: waiting, private loopback addresses, and the watch for leftovers."""
