"""What the page that a server runs (`live_page`) and the one that runs itself (`standalone`) share:
the scene that they show, what can be changed, what they are sent."""
