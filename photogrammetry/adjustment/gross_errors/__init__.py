"""The search for gross errors: hypotheses, suspicion, trial adjustments (snooping), robust solution, wording."""
