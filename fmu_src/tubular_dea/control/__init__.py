"""How the tube is best driven: when to pulse it, and how to hold it where it would not stay by itself."""
