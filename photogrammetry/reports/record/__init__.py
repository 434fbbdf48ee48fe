"""Parts of a report that make it a record: origin, assumptions, orientations, every observation, reliability."""
