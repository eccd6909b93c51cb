"""The report of the published experiments: one page as HTML, as Markdown and as JSON."""

from helideck.reproduction.document import as_document as as_document
from helideck.reproduction.html import write_html as write_html
from helideck.reproduction.markdown import write_markdown as write_markdown
from helideck.reproduction.run import Reproduction as Reproduction
