"""The answer: result.json, remarks, and the curve of each effect."""
