"""The parser's complaint, which comes as a box of several sections, as one line."""

import re

_FRAME = re.compile(r"^\s*[│|]?\s?(.*?)\s*[│|]?\s*$")
_RULE = re.compile(r"^[─\s-]*$")


def one_line(box: str) -> str:
    """The message with the options or verbs that may have been meant; hints on where to find help are left out."""
    lines = [_FRAME.sub(r"\1", line) for line in box.splitlines() if not line.lstrip().startswith(("╭", "╰"))]
    sections: list[list[str]] = [[]]
    for line in lines:
        if _RULE.match(line):
            sections.append([])
        else:
            sections[-1].append(line)
    sections = [section for section in sections if any(section)]
    if not box.startswith("╭"):  # drawn without box characters, the title stands over the first rule
        sections = sections[1:]
    if not sections:
        return "the arguments could not be understood"
    message = " ".join(" ".join(sections[0]).split()).rstrip(".")
    for section in sections[1:]:
        if section[0].startswith("Perhaps you meant"):
            # an option stands indented, its help deeper
            meant = [line.split()[0] for line in section[1:] if line.split()[:1] and line.lstrip().startswith("-")]
            if meant:
                message += f"; did you mean {' or '.join(dict.fromkeys(meant))}?"
        elif section[0].startswith("Available subcommands"):
            message += "; " + " ".join(" ".join(section).split()).replace("Available subcommands", "there are")
    return message[0].lower() + message[1:]
