"""The jumper: the stick model of Fig. 6."""
