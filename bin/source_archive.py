"""What the source archive holds beside the package; pyproject.toml names it as setuptools' command `sdist`."""

from setuptools.command.sdist import sdist

FOLDERS = ("arpa_models", "bin", "docs", "tests")


class SourceArchive(sdist):
    """All that the tests need, so that whoever has the archive can run them: setuptools itself takes a part of them."""

    def make_distribution(self) -> None:
        """Write the archive, with the FOLDERS and without what Python and its tools left there."""
        for folder in FOLDERS:
            self.filelist.graft(folder)
        self.filelist.exclude_pattern(r"(^|/)(__pycache__|\.[^/]+)/", is_regex=True)
        super().make_distribution()
