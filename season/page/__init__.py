"""`season.html`: the season on one page, which needs no other file but the reports that its dots lead to."""
