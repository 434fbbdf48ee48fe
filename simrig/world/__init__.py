"""What there is to see: scenario, hill, flight, jumper, and the truth about them."""
