"""`python -m hapticlink.orchestrator`: the command `hapticlink`."""

from hapticlink.orchestrator.commands import main

if __name__ == "__main__":
    main()
