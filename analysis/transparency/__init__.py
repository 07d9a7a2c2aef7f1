"""What the hand feels of the ideal mechanism."""
