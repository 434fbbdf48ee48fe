"""The paper's procedures: calibration of the cameras (step 1) and orientation on the hill (step 2)."""
