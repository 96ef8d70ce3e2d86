"""Speed of pcjax against what one would write instead: `python -m benchmarks`."""
