"""Files fetched from a public origin, once, with a progress bar, and kept only when they are the right ones."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

TIMEOUT = 30.0  # seconds without an answer


class NotFetched(RuntimeError):
    """A file that is neither in the cache nor could be fetched; says why."""


@dataclass(frozen=True)
class Origin:
    """A folder of a public GitHub repository at one commit, and the sha256 of the files we read from it.

    size : of these files together, bytes.     licence, citation : as the people say who made them.
    """

    repository: str
    commit: str
    folder: str
    sha256: dict[str, str]
    size: int = 0
    licence: str = "none stated"
    citation: str = ""
    host: str = "https://raw.githubusercontent.com"

    @property
    def url(self) -> str:
        """Where the files are, with a slash at the end."""
        return f"{self.host}/{self.repository}/{self.commit}/{self.folder}/"

    def fetch(self, name: str, cache: Path) -> Path:
        """The file in ``cache``, which must match its hash; fetched, if it is not there or does not.

        It is written under another name until it is whole and right.  Raises NotFetched.
        """
        import pooch  # here, so that readers of files need no network's tools
        from tqdm.auto import tqdm

        pooch.get_logger().setLevel("WARNING")  # its lines would land in a lab's output
        registry = {name: f"sha256:{self.sha256[name]}"}
        store = pooch.create(path=cache, base_url=self.url, registry=registry, retry_if_failed=0)
        # An empty bar counts as no bar at all: pooch puts the file's length in place of the 1.
        bar = tqdm(desc=f"{cache.name}/{name}", total=1, unit="B", unit_scale=True, leave=False, disable=None)
        try:
            return Path(store.fetch(name, downloader=pooch.HTTPDownloader(bar, chunk_size=2**14, timeout=TIMEOUT)))
        except Exception as error:  # whatever stops a download, the reader needs the same remedy
            raise NotFetched(_why(error)) from error
        finally:
            bar.close()


def _why(error: Exception) -> str:
    """What stopped a download, in words, with the name of the error."""
    if isinstance(error, ValueError) and "hash" in str(error):  # pooch's sentence has both hashes
        return str(error)
    words = {"ChunkedEncodingError": "the download broke off", "HTTPError": "the server refused",
             "ConnectionError": "no connection", "Timeout": "no answer",
             "PermissionError": "the cache is read-only"}  # fmt: skip
    known = [words[kind.__name__] for kind in type(error).__mro__ if kind.__name__ in words]
    answer = getattr(getattr(error, "response", None), "status_code", None)
    return ", ".join([*known[:1], *([f"status {answer}"] if answer else []), type(error).__name__])
