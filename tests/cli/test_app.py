"""How verbs print."""

from vgps.cli.app import print_note


def test_a_note_is_printed_verbatim(capsys):
    print_note("[red]run[/blue] :car: 1")
    assert capsys.readouterr().out == "note: [red]run[/blue] :car: 1\n"
