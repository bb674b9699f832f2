"""Tables of Python source: arms, scenarios and odd values."""

# For each arm: source, number of joints, name of a frame ("" for none).
ARMS = [
    ("al.planar_pr(2.0, 0.5, 0.5)", 2, ""),
    ("al.pendulum(1.2, 5.0)", 1, ""),
    ("al.planar_arm([0.5, 0.4])", 2, "link2"),
    ("al.planar_arm([0.5, 0.4, 0.3])", 3, "link3"),
    ('al.load_urdf(al.example_urdf("six_axis"))', 6, "flange"),
    ('al.load_urdf(al.example_urdf("planar_2r"))', 2, "tip"),
    ('al.Arm.from_chain([{"type": "R", "axis": [0, 0, 1], "phi": [1, .1, 0, 0, .2, 0, 0, .2, 0, .2]}])', 1, "link1"),
]
ODD = [
    "None", "True", "False", "0", "1", "-1", "2**31", "2**63", "10**400", "0.0", "-0.0", "1e-320", "1e308", "-1e308", "float('nan')",
    "float('inf')", "-float('inf')", "1j", "''", "'x'", "'link1'", "'a\\0b'", "'\\udc80'", "'é' * 3000", "b'x'", "b''", "[]", "[[]]",
    "()", "{}", "{1: 2}", "set()", "[None]", "[1.0, 'x']", "['1.0', '2.0']", "[[1.0], [1.0, 2.0]]", "[True, False]", "object()",
    "Ellipsis", "NotImplemented", "int", "al", "al.Status.SUCCESS", "slice(None)", "range(3)", "range(10**15)", "iter([1.0, 2.0])",
    "(x for x in [1.0, 2.0])", "lambda *a, **k: None", "lambda *a, **k: 'x'", "lambda *a, **k: np.zeros(7)", "print", "np", "np.float64",
    "np.array([])", "np.array(1.0)", "np.array('x')", "np.array(['a', 'b'])", "np.array([None, 1.0])",
    "np.array([1.0, 2.0], dtype=object)", "np.array([1 + 1j, 2])", "np.array([True, False])", "np.zeros((0, 2))", "np.zeros((2, 0))",
    "np.zeros((1,) * 30)", "np.zeros((2, 2, 2, 2))", "np.full(2, np.nan)", "np.array([np.inf, 0.0])", "np.float32([0.5, 0.25])",
    "np.float16([0.5, 0.25])", "np.longdouble([0.5, 0.25])", "np.array([2**60 + 1, 1])", "np.array([0.1, 0.2], dtype='>f8')",
    "np.arange(4.0)[::-2]", "np.asfortranarray(np.eye(2))", "np.eye(2)", "np.eye(3)", "np.zeros((2, 2))", "np.broadcast_to(1.0, 10**10)",
    "np.broadcast_to(0.1, (10**8, 2))", "np.broadcast_to(np.eye(2), (10**9, 2, 2))", "np.ma.masked_array([1.0, 2.0], [False, True])",
    "np.ma.masked", "np.matrix([[1.0, 2.0]])", "np.datetime64('2020-01-01')", "np.array(['2020-01-01'], dtype='M8[D]')",
    "np.zeros(2, dtype=[('a', float), ('b', int)])", "np.recarray(2, dtype=[('a', float)])", "np.zeros(2).view(odd.Subclass)",
    "memoryview(b'abcdefgh')", "memoryview(np.zeros(2))", "bytearray(16)", "odd.Huge()", "odd.Endless()", "odd.Shrinking()", "odd.Same()",
    "odd.loop()", "odd.deep()", "odd.deep(40)", "odd.deep_dict()", "odd.deep_dict(50)", "Fraction(1, 3)", "Decimal('0.5')",
    "Path('nowhere')", "Path('/')", "'/dev/zero'", "'/dev/null'", "'nowhere.toml'", "'<robot/>'", "'<robot name=\"x\">'",
    "al.planar_pr(2.0, 0.5, 0.5)", "al.Hold([0.0, 0.0])", "al.RigidArm(al.planar_arm([0.5, 0.4]))", "al.Sampling(1e-3)",
    "al.JointStops(1.0)", "[al.Hold([0.0])]", "[al.planar_pr(2.0, 0.5, 0.5)]", "al.Event.contact()", "np.random.default_rng(0)",
    "type('T', (), {})()",
]  # fmt: skip
METHODS = {
    "priority": ["exact", "clamp", "damped", "chiaverini", "sns"],
    "fixed": ["euler", "semi_implicit", "rk4", "ros2"],
    "adaptive": ["dopri5", "dop853", "radau5", "rodas4"],
}
SCENARIO = {
    "arm": {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5},
    "motion": {"kind": "Quintic", "q0": [0.0, 0.0], "q1": [0.5, 1.0], "duration": 0.5},
    "law": {"kind": "Adaptive", "kp": [40.0, 20.0], "kd": [20.0, 10.0], "gamma": 5.0},
    "run": {"q0": [0.1, 0.0], "t_end": 0.05, "dt": 5e-3},
}
