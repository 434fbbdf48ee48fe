"""The shared vocabulary: settings, pulse, frame, tag, clocks, errors, topics, shared-memory ring."""
