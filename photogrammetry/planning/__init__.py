"""How accurate a network will be, before anybody carries a ball up the hill."""
