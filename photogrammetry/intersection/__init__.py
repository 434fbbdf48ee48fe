"""Step 3: points and lines of the jumper and the skis by intersection (appendix C)."""
