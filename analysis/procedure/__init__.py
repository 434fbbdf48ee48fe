"""The whole analysis: from a log and the survey of the balls to measured jumps, their verdict and their files."""
