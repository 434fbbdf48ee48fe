"""The recorder process while it runs: cameras' rings in, triplets, pre-roll and recordings out."""
