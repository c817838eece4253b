"""The laws of delay: a module of this folder is a law and is registered by being here."""
