"""The programs of the simulated hill: processes of simulated cameras, their owner, and the scene of back end "sim"."""
