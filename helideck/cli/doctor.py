"""`helideck doctor`."""

from dataclasses import dataclass

from helideck.cli.document import emit


@dataclass(frozen=True)
class Doctor:
    """Check rendering, versions, cores and memory; say what to install.

    Exit code 1 only where nothing can be rendered.

    Example: helideck doctor --json
    """

    json: bool = False
    """One JSON document on stdout."""

    def run(self) -> int:
        """Print the report."""
        from helideck.doctor import doctor

        report = doctor()
        if self.json:
            emit({
                "can_render": report.can_render,
                "renderer": report.drawing.renderer,
                "software": report.drawing.software,
                "opengl": report.drawing.opengl,
                "first_picture_s": report.drawing.seconds,
                "render_error": report.drawing.error,
                "versions": report.versions,
                "cores": report.cores,
                "memory_bytes": report.memory,
                "warnings": report.warnings,
                "install": report.install,
            })
        else:
            rows = {"renderer": report.drawing.renderer or f"none: {report.drawing.error}"}
            if report.drawing.opengl:
                rows |= {"OpenGL": report.drawing.opengl, "first picture": f"{report.drawing.seconds:.2f} s"}
            rows |= {name: found or "not installed" for name, found in report.versions.items()}
            rows |= {"cores": str(report.cores), "memory": f"{report.memory / 2**30:.1f} GiB"}
            for name, value in rows.items():
                print(f"{name:<14}{value}")
            for warning in report.warnings:
                print(f"warning: {warning}")
            for missing in report.install:
                print(f"install: {missing}")
        return 0 if report.can_render else 1
