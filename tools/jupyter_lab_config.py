"""How `make lab` opens JupyterLab: at the learner's copies, on this machine only, without news.

python -m jupyter lab --config=tools/jupyter_lab_config.py
"""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

c = get_config()  # noqa: F821
# The house is the root, so that a link from a lab to the book's pages leads somewhere; the desk is where one starts.
c.ServerApp.root_dir = str(ROOT)
c.ServerApp.preferred_dir = str(ROOT / "my_labs")
c.ServerApp.ip = "127.0.0.1"
# Warnings and the address to open are shown; the list of every extension that was loaded is not.
c.ServerApp.log_level = "WARN"
c.LabApp.log_level = "WARN"
# Defaults that a learner may still change in JupyterLab's settings: no question about news, pages shown as pages.
c.LabApp.app_settings_dir = str(ROOT / "tools" / "jupyterlab")
# No request to another server.
c.LabApp.news_url = None
c.LabApp.check_for_updates_class = "jupyterlab.NeverCheckForUpdate"
