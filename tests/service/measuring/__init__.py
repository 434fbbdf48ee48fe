"""The measuring of logs after their recording."""
