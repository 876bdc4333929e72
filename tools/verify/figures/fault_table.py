"""Print the fault table as it stands in docs/explanation/supervisor.md; a test compares the two."""

from glider.firmware.faults import markdown_rows


def main() -> None:
    print(*markdown_rows(), sep="\n")


if __name__ == "__main__":
    main()
