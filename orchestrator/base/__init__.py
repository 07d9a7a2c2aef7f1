"""What every room uses: faults, exact time, signals of the operating system, temporary folders."""
