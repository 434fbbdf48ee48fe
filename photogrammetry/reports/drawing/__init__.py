"""The drawings of reports, in SVG."""
