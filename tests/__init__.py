from hypothesis import settings

# A property holds or it does not; how long a busy machine takes over one example is no part of it.
settings.register_profile("course", deadline=None)
settings.load_profile("course")
