"""The page: the tube, the assisted heart and recordings in a browser, from the same C as everywhere."""
