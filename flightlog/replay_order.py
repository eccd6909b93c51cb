"""Puts a recording's motion and curves before its pictures.

A viewer shows what it has read so far. Pictures are nearly all of a recording and are written first, in flight; in a
browser the scene would stay empty until the last of them has come.
"""

import os
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

COMPLETE = 0.8  # rerun does not tell of a full disk; a copy smaller than this share of the original is no copy


def pictures_last(file: Path, layout: rrb.Blueprint, pictures: str) -> bool:
    """Rewrite the recording with the entities below `pictures` at its end; whether it could be done.

    The file is replaced whole or stays as it is.
    """
    draft = file.with_suffix(".rrd.part")
    reader = RrdReader(str(file))
    source = reader.recordings()[0]
    copy = rr.RecordingStream(source.application_id, recording_id=source.recording_id, send_properties=False)
    try:
        copy.save(draft, default_blueprint=layout)
    except RuntimeError:
        return False
    below = f"{pictures}/**"
    copy.send_chunks(reader.stream().drop(content=below))
    copy.send_chunks(reader.stream().filter(content=below))
    copy.flush()
    copy.disconnect()
    done = draft.stat().st_size > COMPLETE * file.stat().st_size
    if done:
        os.replace(draft, file)
    else:
        draft.unlink()
    return done
