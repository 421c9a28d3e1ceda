import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.config import read_config
from vgps.config.yaml_text import YamlTextError, parse_yaml
from vgps.errors import ConfigError


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "line", "problem"),
    [
        ("a: 1\nb: 2\na: 3", 3, "key a is given twice, first on line 1"),
        ("a:\n  b: 1\n  b: 1", 3, "key b is given twice, first on line 2"),
        ("a: &x\n  - *x", 2, "alias *x within what it stands for"),
        ("[" * 5000, 1, "nested deeper than 50 levels"),
        ("a: 2026-13-01", None, "month must be in 1..12"),
        ("a: " + "9" * 5000, None, "integer string"),
        ("a: 1" + ":59" * 3000, 1, "an integer of more than"),
        ("? [1, 2]\n: 3", 1, "unhashable key"),
        ("a: !!python/object/apply:os.system [true]", 1, "could not determine a constructor"),
        (b"a: \xff", None, "invalid start byte"),
        ("- 1\n" * 30_000, None, "120000 characters"),
    ],
)
def test_what_is_not_plain_data_is_refused_with_its_line(text, line, problem):
    with pytest.raises(YamlTextError) as error:
        parse_yaml(text)
    assert problem in error.value.problem and error.value.line == line


def test_aliases_are_read_until_they_multiply():
    assert parse_yaml("a: &x [1, 2]\nb: *x\nc: {<<: {d: 1}}") == {"a": [1, 2], "b": [1, 2], "c": {"d": 1}}
    bomb = "a0: &a0 [1]\n" + "".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 9))
    with pytest.raises(YamlTextError, match="too many values"):
        parse_yaml(bomb)


plain = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**9), 10**9) | st.sampled_from(["a", "b c", "ü"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from("abc"), inner),
    max_leaves=10,
)


@pytest.mark.slow
@given(plain)
def test_what_is_written_is_read(value):
    yaml = pytest.importorskip("yaml")
    assert parse_yaml(yaml.safe_dump(value)) == value


def test_a_setting_given_twice_is_one_line(tmp_path):
    file = tmp_path / "c.yaml"
    file.write_text("gps:\n  n: 2\n  n: 4\n")
    with pytest.raises(
        ConfigError, match=r"c\.yaml, line 3: not YAML \(key n is given twice, first on line 2"
    ):
        read_config(file)
