"""The workbench: the commands in a browser, on the machine of the user, without any network."""
