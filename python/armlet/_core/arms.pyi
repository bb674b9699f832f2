"""Types of arms and of the functions that make or restore them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from typing import Any, Literal, final

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from ..identification import BaseParameters, Identification, ParameterReport
from ..symbolic import Formulas
from ._types import _Array, _Number

def planar_pr(A: float, B: float, C: float) -> Arm:
    """The robot with a prismatic and a revolute joint on a horizontal plane, `M = [[A, B cos q2], [B cos q2, C]]`.

    Args:
        A: mass of both links, kg; > 0.
        B: mass of link 2 times the distance of its centre from the joint, kg m; `A C > B^2`.
        C: inertia of link 2 about the joint, kg m^2; > 0.

    Raises:
        InputError: a parameter is not finite, or the mass matrix is not positive definite at every q.

    Source: Robotics 2 exam, Sapienza, 10 June 2022, exercise 1. The arm has no frames.

    Returns:
        The arm, with two joints and no frames.

    >>> import armlet as al
    >>> al.planar_pr(2.0, 0.5, 0.5).mass_matrix([0.0, 0.0])
    array([[2. , 0.5],
           [0.5, 0.5]])
    """

def planar_arm(
    lengths: ArrayLike,
    *,
    masses: ArrayLike | None = None,
    coms: ArrayLike | None = None,
    inertias: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
) -> Arm:
    """A planar arm with n revolute joints in the x-y plane; `q1` is measured from the x axis.

    The frames "link1" to "linkn" are at the tips of the links.

    Args:
        lengths: lengths of the links, `(n,)`, m; not negative.
        masses: masses of the links, `(n,)`, kg, not negative; 1 kg per metre of length if None (keyword only, as all below).
        coms: distance of each link's centre of mass from the joint of the link, `(n,)`, m; half the length if None.
        inertias: inertia of each link about its centre of mass, `(n,)`, kg m^2, not negative; the inertia of a uniform rod if None.
        gravity: acceleration of gravity in the x-y plane, `(2,)`, m/s^2; (0, -9.81) if None.

    Returns:
        The arm.

    Raises:
        InputError: a shape is wrong, a number is not finite, or a length, mass or inertia is negative.

    Source: [SicilianoEtAl2009], section 7.3; docs/arms.md.

    >>> import armlet as al
    >>> al.planar_arm([1.0, 1.0]).position([0.0, 0.0], "link2")
    array([2., 0., 0.])
    """

def pendulum(inertia: float, gravity_moment: float) -> Arm:
    """A pendulum of one link: `inertia a + gravity_moment sin(q) = tau`, where `q` is measured from the downward vertical.

    Args:
        inertia: inertia of the link about the joint, kg m^2; > 0.
        gravity_moment: mass times gravity times the distance of the centre of mass from the joint, N m.

    Source: Robotics 2 exam, Sapienza, 10 June 2022, exercise 4.

    Returns:
        The arm, with one joint and the frame "link1", whose origin is on the joint axis.

    Raises:
        InputError: a number is not finite, or the inertia is not positive.

    >>> import armlet as al
    >>> float(al.pendulum(1.0, 2.0).gravity([1.5707963267948966])[0])
    2.0
    """

def load_urdf(
    path_or_xml: str | PathLike[str],
    *,
    gravity: ArrayLike | None = None,
    root: str | None = None,
    tip: str | None = None,
    mimic: Literal["joined", "independent"] = "joined",
    search_path: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
    xacro_arguments: Mapping[str, object] | None = None,
) -> Arm:
    """Load an arm from a URDF file or from URDF text: any tree of revolute, continuous, prismatic and fixed joints.

    Args:
        path_or_xml: a path, `package://name/file`, or a string of XML. The Python package `xacro`, which must be installed, expands a
            file whose name ends in `.xacro`.
        gravity: acceleration of gravity in the axes of the base, `(3,)`, m/s^2; 9.81 m/s^2 along -z of the file's root if None (keyword
            only).
        root: name of the link that becomes the fixed base; the file's root if None (keyword only).
        tip: name of a link; only the joints between the root and this link remain. All joints remain if None (keyword only).
        mimic: treatment of joints with `<mimic>` (keyword only). "joined": the joint follows its leader, and both are one degree of
            freedom. "independent": the joint is a separate degree of freedom.
        search_path: folders in which `package://` searches; each folder is a package, or contains packages (keyword only). The folders of
            the environment variables `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH` are searched after them.
        xacro_arguments: values of the arguments that `<xacro:arg>` declares, by name (keyword only).

    A *follower* is a joint whose position is `multiplier q_leader + offset`. Its body remains in the arm, but `q` has no entry for it.
    `arm.file_positions(q)` returns its position. The limits of a follower narrow the position and speed limits of the leader, unless they
    would then allow no motion. The leader gets `multiplier**2` of the follower's armature and damping, and `|multiplier|` of its Coulomb
    friction. The leader's effort limit does not change, because one motor moves the leader and its followers. If `root` and `tip` exclude a
    leader, its first follower becomes the leader.

    With `root` or `tip`, faults of the file outside of the chain do not matter: `arm.report` names the first of them. It also names the
    parts that the arm lacks, and gravity in the axes of `root`. Without `gravity`, this is gravity of the whole robot, with the joints
    between the file's root and `root` at zero. So a tilted mount tilts gravity. For other positions of these joints, give `gravity`.

    The order of `q` is depth first, with siblings in the order of the file. The names of the frames are the names of the links. Meshes are
    never opened. `arm.report` lists unusual values, parts that armlet does not use, and a mass matrix that is not positive definite.

    Raises:
        ModelError: the model is not well formed, or a number is implausible. `.file` and `.line` locate the error.
        InputError: an argument is wrong, a file cannot be read, a package is not found, or xacro reports an error. A path that leads out of
            its package also raises it.
        ImportError: the file is xacro, and the package `xacro` is not installed.

    Returns:
        The arm.

    Source: docs/arms.md.

    >>> import armlet as al
    >>> al.load_urdf(al.example_urdf("planar_2r")).n
    2
    """

def example_urdf(name: str) -> str:
    """Return the text of an example URDF of the package.

    Args:
        name: name of the example, such as "six_axis". The error for an unknown name lists the valid names.

    Returns:
        The URDF as a string, for `load_urdf`.

    Raises:
        InputError: the name is unknown.

    Source: docs/arms.md.

    >>> import armlet as al
    >>> al.load_urdf(al.example_urdf("seven_axis")).n
    7
    """

def project_parameters(pi: ArrayLike, *, length: _Number | None = None, floor: _Number | None = None) -> _Array:
    """Return the nearest inertial parameters that are physically possible.

    For the pseudo-inertia `P` of each body and `D = diag(1/l, 1/l, 1/l, 1)`, the distance is the Frobenius norm of the change of `D P D`,
    in kg. For a body that is not possible, the projection keeps the eigenvectors of `D P D` and raises eigenvalues below the floor to the
    floor. Bodies that are already possible do not change, even if an eigenvalue is below the floor.

    Args:
        pi: inertial parameters, `(10 bodies,)`, in the order and units of `Arm.parameters`: kg, kg m, kg m^2.
        length: `l`, m, which makes mass and moments comparable; 0.1 if None (keyword only).
        floor: smallest eigenvalue of a projected body, relative to the largest eigenvalue of all bodies; 1e-6 if None (keyword only).

    Raises:
        InputError: an argument is not finite or has the wrong shape, or no body has a positive eigenvalue.

    Source: Higham 1988; Wensing, Kim and Slotine 2018.

    Returns:
        The parameters, `(10 bodies,)`, in the order and units of `pi`.

    >>> import armlet as al
    >>> arm = al.planar_arm([1.0])
    >>> pi = arm.parameters
    >>> pi[9] = -1.0
    >>> arm.check_parameters(pi).consistent, arm.check_parameters(al.project_parameters(pi)).consistent
    (False, True)
    """

def _restore(*payload: bytes) -> Any: ...
def _seal(make: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]: ...
def _share(bytes: bytes) -> bytes: ...
def _stored_array(array: NDArray[Any]) -> tuple[Any, ...]: ...
def _restore_array(shape: tuple[int, ...], *shares: bytes) -> _Array: ...
def _restore_planar_pr(pi: Sequence[float]) -> Arm: ...
def _restore_arm(integers: bytes, numbers: bytes, text: bytes) -> Arm: ...
def _restore_tree(state: tuple[Any, ...]) -> Arm: ...
def _urdf_joints(function: str, xml: str) -> list[tuple[str, str, str]]: ...

@final
class Arm:
    """A robot arm: its kinematics and its dynamics `M(q) a + C(q, v) v + g(q) = tau`.

    `load_urdf`, `Arm.from_chain`, `Arm.from_dh`, `planar_arm`, `pendulum` and `planar_pr` make arms. The arm of `planar_pr` has equations
    in closed form, but no links and no frames. Functions of the positions take `q` of the shape `(..., n)` and broadcast over the leading
    axes. For many configurations they use the lanes of SIMD registers and several threads.

    `C` is the matrix of the Christoffel symbols. Angles are in rad, lengths in m, torques in N m, and forces of prismatic joints in N. The
    dynamics include the rotors' inertia (armature), and include friction only with `friction=True`. `planar_pr` has neither, and refuses
    `friction=True` and `armature=True`. Jacobians are geometric: the first three rows are the velocity of the frame's origin, the last
    three the angular velocity, in world axes.
    """
    @staticmethod
    def from_chain(joints: Iterable[Mapping[str, Any]], *, gravity: ArrayLike | None = None) -> Arm:
        """Make an arm from a list of joints, each a dict. `gravity`: `(3,)`, m/s^2, world axes; (0, 0, -9.81) if None.

        Only the key `type` is required:

        - `type`: "R", "P", "F", or "revolute", "continuous", "prismatic", "fixed";
        - `axis`: direction of the joint axis in the joint frame, `(3,)`, of any length > 0; (0, 0, 1) by default;
        - `rpy`, `xyz`: placement of the joint frame in the parent's body frame at q = 0 (rad, m); zero by default;
        - `phi`: the ten inertial parameters about the origin of the body frame, in the order of `Arm.parameters` (kg, kg m, kg m^2); zero
          by default.

        The other keys are `name`, `lower`, `upper`, `velocity`, `effort`, `armature`, `damping`, `friction`, and:

        - `parent`: index of an earlier joint; -1 or None is the base, and the default is the previous joint;
        - `mimic`: a dict with `joint`, the index of the leader, `multiplier` (default 1) and `offset` (default 0), as in a URDF.

        The frames "link1", "link2", .. are the body frames.

        Raises:
            InputError: the list is empty, a key or type is unknown, a name is repeated, a shape is wrong, or a number is not finite. It is
                also raised for an axis of length zero, for an index of no valid joint, and for `lower` above `upper`. A negative
                `velocity`, `effort`, `armature`, `damping` or `friction` also raises it.

        >>> import armlet as al
        >>> arm = al.Arm.from_chain([{"type": "R", "axis": [0, 0, 1], "phi": [1, 0.5, 0, 0, 0, 0, 0, 0, 0, 0.3]}])
        >>> arm.mass_matrix([0.0])
        array([[0.3]])
        """
    @staticmethod
    def from_dh(rows: Iterable[Any], *, convention: str = "standard", gravity: ArrayLike | None = None) -> Arm:
        """Make an arm from Denavit-Hartenberg rows `(a, alpha, d, theta)`, lengths in m and angles in rad.

        A row may also be a dict with the keys `a`, `alpha`, `d`, `theta` and `phi`, which are zero by default. Its key `type` is "R" (the
        default), "P", "revolute", "continuous" or "prismatic". `convention`: "standard" or "modified" (Craig). `gravity`: `(3,)`, m/s^2,
        world axes. The frames "link1", "link2", .. are the Denavit-Hartenberg frames.

        Raises:
            InputError: the list is empty, a key, a type or the convention is unknown, a shape is wrong, or a number is not finite.

        >>> import armlet as al
        >>> al.Arm.from_dh([(1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)]).position([0.0, 0.0], "link2")
        array([2., 0., 0.])
        """
    @property
    def n(self) -> int:
        """Number of joints in `q`. A follower (mimic joint) does not count."""
    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of `q`."""
    @property
    def joint_types(self) -> tuple[str, ...]:
        """Types of the joints, "revolute", "continuous" or "prismatic", in the order of `q`."""
    @property
    def frame_names(self) -> tuple[str, ...]:
        """Names of the frames that kinematic functions accept."""
    @property
    def tip_frame(self) -> str | None:
        """Name of the frame at the tip; None for an arm without moving frames.

        The tip is the moving frame with the longest path from the base. The length of a path is the sum of the distances from joint to
        joint, and from the last joint to the frame, m. Among equally long paths, the last in the order of `frame_names` counts.

        >>> import armlet as al
        >>> al.load_urdf(al.example_urdf("six_axis")).tip_frame
        'flange'
        """
    @property
    def file_joint_names(self) -> tuple[str, ...]:
        """Names of all moving joints, including mimic joints, which follow another joint. Without mimic joints they are `joint_names`.

        Fixed joints of the model's file are not included.

        >>> import armlet as al
        >>> finger = {"type": "P", "axis": [1, 0, 0], "parent": None, "phi": [0.1] + 9 * [0]}
        >>> gripper = al.Arm.from_chain([finger, {**finger, "mimic": {"joint": 0, "multiplier": -1.0}}])
        >>> gripper.n, gripper.joint_names, gripper.file_joint_names
        (1, ('joint1',), ('joint1', 'joint2'))
        """
    @property
    def file_joint_parents(self) -> tuple[int, ...]:
        """For each joint of `file_joint_names`, the index of its parent joint; -1 for a joint on the base.

        >>> import armlet as al
        >>> al.planar_arm([0.5, 0.4]).file_joint_parents
        (-1, 0)
        """
    def file_joint_poses(self, q: ArrayLike, *, out: _Array | None = None) -> _Array:
        """The pose of every joint of `file_joint_names`, `(..., len(file_joint_names), 4, 4)`: a homogeneous transform per joint, lengths in
        m.

        Each transform is the pose of the body that the joint moves. Its origin is on the joint axis. The property `file_joint_parents` has
        the index of each parent, so that lines from parent to joint draw the arm.

        Args:
            q: positions, `(..., n)`, rad or m.
            out: an array to write to (keyword only).

        Raises:
            InputError: `q` is not finite or has the wrong shape, the arm has no links, or `out` cannot be written.

        Source: [Featherstone2008], chapter 4.

        >>> import armlet as al
        >>> al.planar_arm([0.5, 0.4]).file_joint_poses([0.0, 1.0])[:, :3, 3]
        array([[0. , 0. , 0. ],
               [0.5, 0. , 0. ]])
        """
    def file_positions(self, q: ArrayLike) -> _Array:
        """Positions of the joints of `file_joint_names`, `(..., len(file_joint_names))`, rad or m: `multiplier q_leader + offset` for mimic
        joints.

        Args:
            q: positions, `(..., n)`, rad or m.

        Raises:
            InputError: `q` is not finite or has the wrong shape.

        >>> import armlet as al
        >>> finger = {"type": "P", "axis": [1, 0, 0], "parent": None, "phi": [0.1] + 9 * [0]}
        >>> gripper = al.Arm.from_chain([finger, {**finger, "mimic": {"joint": 0, "multiplier": -1.0, "offset": 0.1}}])
        >>> gripper.file_positions([[0.0], [0.04]])
        array([[0.  , 0.1 ],
               [0.04, 0.06]])
        """
    @property
    def frame_joints(self) -> tuple[int, ...]:
        """For each frame of `frame_names`, the index in `file_joint_names` of the joint that moves it; -1 for a frame of the base.

        >>> import armlet as al
        >>> arm = al.planar_arm([0.5, 0.4])
        >>> arm.frame_names, arm.frame_joints
        (('link1', 'link2'), (0, 1))
        """
    @property
    def parameters(self) -> _Array:
        """The inertial parameters, `(p,)`: `m, m cx, m cy, m cz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz` of each joint's body, kg, kg m, kg m^2.

        The bodies have the order of `file_joint_names`. The inertia is about the origin of the body frame, in its axes. For `planar_pr` the
        parameters are `(A, B, C)`.
        """
    @property
    def limits(self) -> dict[str, _Array]:
        """Limits, friction and rotor inertia of the joints by name, each `(n,)`; a limit that the model does not have is infinite.

        `q_min`, `q_max`: rad or m. `v_max`: rad/s or m/s. `effort`, `friction`: N m or N. `damping`: N m s/rad or N s/m. `armature`: kg m^2
        or kg. The dict of `planar_pr` is empty.
        """
    @property
    def gravity_vector(self) -> _Array | None:
        """Gravity in world axes, `(3,)`, m/s^2; None for `planar_pr`, which moves on a horizontal plane."""
    @property
    def report(self) -> tuple[str, ...]:
        """Remarks of `load_urdf` and other readers about unusual or unused parts of the model's file, one string each."""
    def with_parameters(self, pi: ArrayLike) -> Arm:
        """Return a copy of the arm with other inertial parameters, which may be any finite numbers.

        Args:
            pi: the inertial parameters, `(p,)`, in the order of `parameters`: kg, kg m, kg m^2.

        Raises:
            InputError: `pi` is not finite or has the wrong shape.

        >>> import armlet as al
        >>> arm = al.planar_pr(2.0, 0.5, 0.5)
        >>> arm.with_parameters(2.0 * arm.parameters)
        planar_pr(A=4, B=1, C=1)
        """
    def with_drives(self, *, armature: ArrayLike | None = None, damping: ArrayLike | None = None, friction: ArrayLike | None = None) -> Arm:
        """Return a copy of the arm with other rotor inertia and friction, which may be any finite numbers.

        `diag(armature)` is added to the mass matrix of the bodies. Methods with `friction=True` include the friction torque
        `damping v + friction sign(v)`.

        Args:
            armature: rotor inertia at the joint side of the gear, a number or `(n,)`, kg m^2 (kg for a prismatic joint); unchanged if None (keyword
                only).
            damping: viscous friction, a number or `(n,)`, N m s/rad (N s/m for a prismatic joint); unchanged if None (keyword only).
            friction: Coulomb friction, a number or `(n,)`, N m (N for a prismatic joint); unchanged if None (keyword only).

        Raises:
            InputError: an argument is not finite or has the wrong shape, or the arm has no links.

        >>> import armlet as al
        >>> arm = al.pendulum(1.0, 1.0).with_drives(armature=[0.5])
        >>> float(arm.mass_matrix([0.0])[0, 0]), float(arm.limits["armature"][0])
        (1.5, 0.5)
        """
    def with_gravity(self, gravity: ArrayLike) -> Arm:
        """Return a copy of the arm with another gravity.

        Args:
            gravity: acceleration of gravity, `(3,)`, m/s^2, world axes.

        Raises:
            InputError: `gravity` is not finite or has the wrong shape, or the arm has no links.

        >>> import armlet as al
        >>> al.planar_arm([1.0]).with_gravity([0.0, 0.0, 0.0]).gravity([0.3])
        array([0.])
        """
    def with_frame(self, name: str, parent: str, *, xyz: ArrayLike | None = ..., rpy: ArrayLike | None = ...) -> Arm:
        """Return a copy of the arm with a new frame, such as a tool frame, that is fixed to an existing frame.

        Args:
            name: name of the new frame.
            parent: name of the existing frame.
            xyz: origin of the new frame in the axes of the parent, `(3,)`, m; zero if None (keyword only).
            rpy: roll, pitch and yaw of the new frame relative to the parent, `(3,)`, rad, `R = Rz(yaw) Ry(pitch) Rx(roll)`; zero if None
                (keyword only).

        Raises:
            InputError: the name exists already, the parent is unknown, a number is not finite, or the arm has no links.

        >>> import armlet as al
        >>> arm = al.planar_arm([1.0]).with_frame("tool", "link1", xyz=[0.2, 0.0, 0.0])
        >>> arm.position([0.0], "tool")
        array([1.2, 0. , 0. ])
        """
    def with_payload(self, frame: str, mass: float, com: ArrayLike | None = ..., inertia: ArrayLike | None = ...) -> Arm:
        """Return a copy of the arm with a load that is fixed to a frame.

        Args:
            frame: name of the frame.
            mass: mass of the load, kg, not negative.
            com: centre of mass of the load in the frame, `(3,)`, m; the frame's origin if None.
            inertia: inertia of the load about its centre of mass, in the axes of the frame, `(3, 3)`, kg m^2; zero if None.

        Raises:
            InputError: the frame is unknown, a number is not finite, the mass is negative, or the arm has no links. An inertia that is not
                symmetric, or that is physically impossible, also raises it.

        >>> import armlet as al
        >>> arm = al.planar_arm([1.0])
        >>> (arm.with_payload("link1", 2.0).gravity([0.0]) - arm.gravity([0.0])).round(6)
        array([19.62])
        """
    def locked(self, joints: dict[str, float]) -> Arm:
        """Return a copy of the arm in which some joints are locked at constant positions.

        `q` has no entries for locked joints. The body of a locked joint becomes a part of its parent's body.

        Args:
            joints: a dict from the names of the locked joints to their positions, rad or m.

        Raises:
            InputError: a joint is unknown, a position is not a finite number, or the arm has no links.

        >>> import armlet as al
        >>> al.planar_arm([1.0, 1.0]).locked({"joint2": 0.0}).position([0.0], "link2")
        array([2., 0., 0.])
        """
    def to_urdf(self) -> tuple[str, list[str]]:
        """Return the arm as URDF text, and a list of strings that name the properties that are lost and the links that are added.

        If the list is empty, `load_urdf(text)` returns an equal arm, without rounding errors. The attribute `armature` of `<dynamics>` is
        the rotor inertia. The angles and the centre of mass in a URDF are rounded. So the attribute `rotation` of `<origin>` has the exact
        rotation, and the attribute `parameters` of `<inertial>` has the ten inertial parameters. Other programs ignore these attributes.

        Raises:
            InputError: the arm has no links.

        >>> import armlet as al
        >>> arm = al.load_urdf(al.example_urdf("seven_axis"))
        >>> text, lost = arm.to_urdf()
        >>> lost, al.load_urdf(text) == arm
        ([], True)
        """
    def mass_matrix(self, q: ArrayLike, *, out: _Array | None = None) -> _Array:
        """The mass matrix `M(q)`, `(..., n, n)`, kg m^2, kg m or kg. Its diagonal includes the rotors' inertia (armature).

        Args:
            q: positions, `(..., n)`, rad or m.
            out: an array to write to (keyword only).

        Raises:
            InputError: `q` is not finite or has the wrong shape, or `out` cannot be written.

        Source: the composite-rigid-body algorithm, Featherstone, Rigid Body Dynamics Algorithms, 2008.

        >>> import armlet as al
        >>> al.planar_pr(2.0, 0.5, 0.5).mass_matrix([0.0, 0.0])
        array([[2. , 0.5],
               [0.5, 0.5]])
        """
    def coriolis_matrix(self, q: ArrayLike, v: ArrayLike, *, out: _Array | None = None) -> _Array:
        """The Coriolis matrix `C(q, v)` of the Christoffel symbols, `(..., n, n)`: `C(q, x) y = C(q, y) x` and `dM/dt = C + C'`.

        Args:
            q, v: positions (rad or m) and velocities (rad/s or m/s), `(..., n)`, broadcast over the leading axes.
            out: an array to write to (keyword only).

        Raises:
            InputError: an argument is not finite or has the wrong shape, or `out` cannot be written.

        Source: Echeandia and Wensing, Numerical methods to compute the Coriolis matrix and Christoffel symbols, 2021.

        >>> import armlet as al
        >>> al.planar_pr(2.0, 0.5, 0.5).coriolis_matrix([0.0, 1.5707963267948966], [0.0, 2.0])
        array([[ 0., -1.],
               [ 0.,  0.]])
        """
    def christoffel(self, q: ArrayLike, *, out: _Array | None = None) -> _Array:
        """The Christoffel symbols of the first kind, `(..., n, n, n)`: `C(q, v)[i, j] = sum_k c[i, j, k] v[k]`.

        `c[i, j, k] = (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) / 2`, symmetric in `j` and `k`. The slice `c[i]` is the matrix `C_i` of the
        quadratic form `(C(q, v) v)_i = v' C_i v`. The unit of `c[i, j, k]` is the unit of `tau_i` divided by the units of `v_j` and `v_k`.

        Args:
            q: positions, `(..., n)`, rad or m.
            out: an array to write to (keyword only).

        Raises:
            InputError: `q` is not finite or has the wrong shape, or `out` cannot be written.

        Source: Echeandia and Wensing, Numerical methods to compute the Coriolis matrix and Christoffel symbols, 2021.

        >>> import armlet as al
        >>> al.planar_pr(2.0, 0.5, 0.5).christoffel([0.0, 1.5707963267948966])[0]
        array([[ 0. ,  0. ],
               [ 0. , -0.5]])
        """
    def gravity(self, q: ArrayLike, *, out: _Array | None = None) -> _Array:
        """The gravity torque `g(q)`, `(..., n)`, N m or N: the gradient of the potential energy.

        Args:
            q: positions, `(..., n)`, rad or m.
            out: an array to write to (keyword only).

        Raises:
            InputError: `q` is not finite or has the wrong shape, or `out` cannot be written.

        >>> import armlet as al
        >>> al.planar_arm([1.0], masses=[2.0]).gravity([0.0])
        array([9.81])
        """
    def bias(self, q: ArrayLike, v: ArrayLike, *, friction: bool = False, out: _Array | None = None) -> _Array:
        """The torque at zero acceleration: `C(q, v) v + g(q)`, `(..., n)`, N m or N.

        Args:
            q, v: positions (rad or m) and velocities (rad/s or m/s), `(..., n)`, broadcast over the leading axes.
            friction: add the joints' `damping v + friction sign(v)` (keyword only).
            out: an array to write to (keyword only).

        Raises:
            InputError: an argument is not finite or has the wrong shape, or `out` cannot be written.

        >>> import armlet as al
        >>> al.planar_pr(2.0, 0.5, 0.5).bias([0.0, 1.5707963267948966], [0.0, 2.0])
        array([-2.,  0.])
        """
    def inverse_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        wrench: ArrayLike | None = None,
        wrench_frame: str | None = None,
        friction: bool = False,
        out: _Array | None = None,
    ) -> _Array:
        """Inverse dynamics: the torque `tau = M a + C v + g - J' wrench`, `(..., n)`, N m or N.

        Args:
            q, v, a: positions (rad or m), velocities (per s) and accelerations (per s^2), `(..., n)`, broadcast over the leading axes.
            wrench: force and moment `[f; m]` on the arm, `(..., 6)`, N and N m, in world axes at a frame's origin (keyword only).
            wrench_frame: name of the frame at whose origin the wrench acts (keyword only).
            friction: add the joints' `damping v + friction sign(v)` (keyword only).
            out: an array to write to (keyword only).

        Raises:
            InputError: an argument is not finite or has the wrong shape, `wrench` or `wrench_frame` is alone, the frame is unknown, or
                `out` cannot be written.

        Source: the recursive Newton-Euler algorithm, Luh, Walker and Paul, On-line computational scheme for mechanical manipulators, 1980.

        >>> import armlet as al
        >>> arm = al.planar_arm([1.0], masses=[2.0])
        >>> arm.inverse_dynamics([0.0], [0.0], [0.0], wrench=[0.0, 9.81, 0.0, 0.0, 0.0, 0.0], wrench_frame="link1")
        array([0.])
        """
    def forward_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        *,
        wrench: ArrayLike | None = None,
        wrench_frame: str | None = None,
        friction: bool = False,
        out: _Array | None = None,
    ) -> _Array:
        """Forward dynamics: the acceleration `a = M^-1 (tau + J' wrench - C v - g)`, `(..., n)`, rad/s^2 or m/s^2.

        Args:
            q, v, tau: positions (rad or m), velocities (per s) and torques (N m or N), `(..., n)`, broadcast over the leading axes.
            wrench, wrench_frame: as for `inverse_dynamics` (keyword only).
            friction: subtract the joints' `damping v + friction sign(v)` from the torque (keyword only).
            out: an array to write to (keyword only).

        Raises:
            InputError: as for `inverse_dynamics`, or the mass matrix is singular.

        Source: the articulated-body algorithm, Featherstone, The calculation of robot dynamics using articulated-body inertias, 1983.

        >>> import armlet as al
        >>> al.pendulum(2.0, 3.0).forward_dynamics([0.0], [0.0], [4.0])
        array([2.])
        """
    def regressor(
        self,
        q: ArrayLike,
        v: ArrayLike,
        v_r: ArrayLike,
        a_r: ArrayLike,
        *,
        armature: bool = False,
        friction: bool = False,
        offset: bool = False,
        out: _Array | None = None,
    ) -> _Array:
        """The Slotine-Li regressor `Y`, `(..., n, p)`: `Y(q, v, v_r, a_r) parameters = M a_r + C(q, v) v_r + g`.

        `C` is the Coriolis matrix of `coriolis_matrix`, and `M` excludes the armature, which is not one of the parameters. So
        `regressor(q, v, v, a) @ parameters + armature * a` is the inverse dynamics.

        Args:
            q, v: positions (rad or m) and velocities (rad/s or m/s), `(..., n)`, broadcast over the leading axes.
            v_r, a_r: reference velocities (rad/s or m/s) and accelerations (rad/s^2 or m/s^2), `(..., n)`, broadcast over the leading axes.
            armature: append the `n` columns `diag(a_r)` (keyword only).
            friction: append the `2 n` columns `diag(v_r)` for damping and `diag(sign v)` for Coulomb friction (keyword only).
            offset: append the `n` columns of the identity matrix for torque offsets, after all other columns (keyword only).
            out: an array to write to (keyword only).

        Raises:
            InputError: an argument is not finite or has the wrong shape, or `out` cannot be written.

        Source: [SlotineLi1987], extended to trees of bodies.

        >>> import armlet as al
        >>> al.planar_pr(2.0, 0.5, 0.5).regressor([0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [1.0, 3.0])
        array([[1., 3., 0.],
               [0., 1., 3.]])
        """
    def inverse_dynamics_derivatives(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, friction: bool = False, out: tuple[_Array, _Array, _Array] | None = None
    ) -> tuple[_Array, _Array, _Array]:
        """The partial derivatives of inverse dynamics, `d tau / d q`, `d tau / d v` and `d tau / d a = M`.

        One recursion over composite bodies computes them without difference quotients. Without friction, `d tau / d v = 2 C(q, v)`, where
        `C` is the Coriolis matrix of `coriolis_matrix`.

        Args:
            q, v, a: positions (rad or m), velocities (per s) and accelerations (per s^2), `(..., n)`, broadcast over the leading axes.
            friction: add the damping to `d tau / d v` (keyword only). The derivative of Coulomb friction is zero where `v` is not zero.
            out: a tuple of three arrays to write to (keyword only).

        Returns:
            Three arrays `(..., n, n)`. Row `i`, column `j` is the derivative of `tau_i` with respect to `q_j`, `v_j` or `a_j`.

        Raises:
            InputError: an argument is not finite or has the wrong shape, or `out` cannot be written.

        Source: Carpentier and Mansard 2018.

        >>> import armlet as al
        >>> arm = al.pendulum(2.0, 3.0)
        >>> dtau_dq, dtau_dv, M = arm.inverse_dynamics_derivatives([0.0], [1.0], [0.0])
        >>> float(dtau_dq[0, 0]), float(dtau_dv[0, 0]), float(M[0, 0])
        (3.0, 0.0, 2.0)
        """
    def forward_dynamics_derivatives(
        self, q: ArrayLike, v: ArrayLike, tau: ArrayLike, *, friction: bool = False, out: tuple[_Array, _Array, _Array] | None = None
    ) -> tuple[_Array, _Array, _Array]:
        """The partial derivatives of forward dynamics, `d a / d q`, `d a / d v` and `d a / d tau = M^-1`.

        Args:
            q, v, tau: positions (rad or m), velocities (per s) and torques (N m or N), `(..., n)`, broadcast over the leading axes.
            friction: subtract the joints' friction from the torque (keyword only).
            out: a tuple of three arrays to write to (keyword only).

        Returns:
            Three arrays `(..., n, n)`. Row `i`, column `j` is the derivative of `a_i` with respect to `q_j`, `v_j` or `tau_j`.

        Raises:
            InputError: an argument is not finite or has the wrong shape, the mass matrix is singular, or `out` cannot be written.

        Source: Carpentier and Mansard 2018.

        >>> import armlet as al
        >>> da_dq, da_dv, Minv = al.pendulum(4.0, 3.0).forward_dynamics_derivatives([0.0], [1.0], [0.0])
        >>> float(da_dq[0, 0]), float(Minv[0, 0])
        (-0.75, 0.25)
        """
    def linearize(
        self, q: ArrayLike, v: ArrayLike, tau: ArrayLike, *, friction: bool = False, out: tuple[_Array, _Array] | None = None
    ) -> tuple[_Array, _Array]:
        """The linear model of the arm about a state: `d/dt [dq; dv] = A [dq; dv] + B dtau`.

        `A = [[0, 1], [da/dq, da/dv]]` and `B = [[0], [M^-1]]`. `dq`, `dv` and `dtau` are small deviations from the motion through the
        state, which need not be an equilibrium.

        Args:
            q, v, tau: positions (rad or m), velocities (per s) and torques (N m or N), `(..., n)`, broadcast over the leading axes.
            friction: subtract the joints' friction from the torque (keyword only).
            out: a tuple of two arrays to write to (keyword only).

        Returns:
            `A`, `(..., 2 n, 2 n)`, and `B`, `(..., 2 n, n)`.

        Raises:
            InputError: as for `forward_dynamics_derivatives`.

        >>> import armlet as al
        >>> A, B = al.pendulum(4.0, 3.0).linearize([0.0], [0.0], [0.0])
        >>> (A + 0.0).tolist(), B.tolist()
        ([[0.0, 1.0], [-0.75, 0.0]], [[0.0], [0.25]])
        """
    def show(
        self, q: ArrayLike, *, frames: str | Sequence[str] | None = None, view: ArrayLike | None = None, fig: Figure | None = None
    ) -> Axes:
        """Draw the arm at the positions `q`: its links, its joints with their axes, and named frames. It requires matplotlib (extra `plot`).

        Blue lines are the links, grey lines the displacements of prismatic joints. A coloured bar at each joint has the direction of the
        joint axis, and the colour of the joint in `Run.plot`. The axes of a frame are red (x), green (y) and blue (z). An arm whose joints
        and frames are in a plane of two world axes is drawn in that plane, with dots for axes across it. Another arm, or any arm with `view`,
        is drawn in space, with its shadow on the floor of the figure. A notebook shows the figure below the cell.

        Args:
            q: positions, `(n,)`, rad or m.
            frames: names of the frames to draw (keyword only). None means `tip_frame`, and the ends of other branches that are not close to it.
            view: elevation and azimuth of the eye, `(2,)`, degrees (keyword only). None means the plane of the arm if it has one.
            fig: a matplotlib figure for the drawing (keyword only). None makes one with pyplot.

        Returns:
            The axes of the drawing, a `matplotlib.axes.Axes`, in world axes and m.

        Raises:
            InputError: `q` or `view` is not finite or has the wrong shape, a frame is unknown, or the arm has no frame that moves.
            ImportError: matplotlib is not installed.

        Source: docs/arms.md.

        >>> import armlet as al
        >>> from matplotlib.figure import Figure
        >>> ax = al.load_urdf(al.example_urdf("planar_2r")).show([0.4, 0.8], fig=Figure())
        >>> ax.get_xlabel()
        'x (m)'
        """
    def symbolic(self, *, lengths: bool = False) -> Formulas:
        """Formulas of an arm of at most four joints as sympy expressions: `M(q)`, `C(q, v)`, `g(q)` and the regressor `Y(q, v, v_r, a_r)`.

        The extra `sympy` installs sympy. The inertial parameters of joint 1 are the symbols `m1, mcx1, .., Izz1`, and `Ir1` is the
        inertia of its rotor. The parameters of `planar_pr` are `A, B, C`. Parameters that are zero in this arm do not appear in `M`, `C`
        and `g`. Each expression is collected by parameter and simplified.

        Args:
            lengths: True for symbols of lengths and gravity (keyword only). `x2, y2, z2` is the offset of joint 2 in the axes of the link
                before it, and `gx, gy, gz` is gravity. By default lengths and gravity are numbers.

        Returns:
            An `armlet.symbolic.Formulas`: `.M`, `.C`, `.g`, `.Y`, the symbols `.q, .v, .v_r, .a_r`, their `.values`, `.latex()` and
            `.function(name)`.

        Raises:
            InputError: the arm has more than four joints, including mimic joints.
            ImportError: sympy is not installed.

        >>> import armlet as al
        >>> al.planar_pr(2.0, 0.5, 0.5).symbolic().M
        Matrix([
        [        A, B*cos(q2)],
        [B*cos(q2),         C]])
        """
    def base_parameters(self, *, armature: bool = False, friction: bool = False, offset: bool = False) -> BaseParameters:
        """The base parameters: the smallest set of linear combinations of the inertial parameters that determines the motion of the arm.

        `Y pi = Y_b (P pi)` for every state, where `pi` are the inertial parameters, `Y_b` independent columns of the regressor `Y`, and `P`
        is `.projection`. The columns are examined in order, from base to tip. A column belongs to `Y_b` if it is independent of the columns
        before it. This is tested with regressors at random states, with a fixed seed and the arm's gravity.

        Args:
            armature: include columns for the rotors' inertia (keyword only).
            friction: include columns for damping and Coulomb friction (keyword only).
            offset: include columns for torque offsets (keyword only).

        Returns:
            An `al.BaseParameters`: `.count`, `.projection` `(b, p)`, `.columns`, `.grouping`, `.values`, `.regressor(q, v, v_r, a_r)`.

        Raises:
            InputError: armature, friction or offset for `planar_pr`, which has none.

        Source: Gautier, Numerical calculation of the base inertial parameters of robots, Journal of Robotic Systems 8(4), 1991.

        >>> import armlet as al
        >>> al.pendulum(2.0, 3.0).base_parameters().grouping
        ('mcx[joint1]', 'mcy[joint1]', 'Izz[joint1]')
        """
    def check_parameters(self, pi: ArrayLike | None = None) -> ParameterReport:
        """Check whether inertial parameters are physically possible: the 4 x 4 pseudo-inertia of every body is positive definite.

        The pseudo-inertia is `P = [[S, h], [h', m]]` with the mass `m`, the first moment `h`, and `S = tr(I)/2 1 - I`. `I` is the inertia
        about the origin of the body frame, and `1` the identity matrix. `P` is positive definite if and only if two conditions hold. The
        mass and the principal moments about the centre of mass are positive, and each moment is below the sum of the other two.

        Args:
            pi: inertial parameters, `(p,)`, ten per joint, in the order and units of `parameters`; the arm's parameters if None.

        Returns:
            An `al.ParameterReport`: true if all bodies are possible, with `.eigenvalues` `(joints, 4)` and `.inconsistent`. `str` has a
            line for each impossible body.

        Raises:
            InputError: `pi` is not finite or has the wrong shape, or the arm has no links.

        Source: Wensing, Kim and Slotine 2018.

        >>> import armlet as al
        >>> arm = al.load_urdf(al.example_urdf("six_axis"))
        >>> arm.check_parameters().consistent
        True
        """
    def project_parameters(self, pi: ArrayLike, *, length: _Number | None = None, floor: _Number | None = None) -> _Array:
        """Return the nearest physically possible parameters, `(p,)`, like `al.project_parameters`, and check that `pi` has this arm's size.

        >>> import armlet as al
        >>> arm = al.load_urdf(al.example_urdf("six_axis"))
        >>> bool((arm.project_parameters(arm.parameters) == arm.parameters).all())
        True
        """
    def identify(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        tau: ArrayLike,
        *,
        armature: bool = False,
        friction: bool = False,
        noise: ArrayLike | None = None,
        cutoff: _Number | None = None,
        offset: bool = False,
    ) -> Identification:
        """Identify base parameters from recorded motion and torque by least squares.

        The estimate `beta` of the base parameters is the least-squares solution of `W_b beta = tau`, where `W_b` contains the base
        regressors of all samples. The standard deviations of `beta` are computed from the residual.

        Args:
            q, v, a: positions (rad or m), velocities (per s) and accelerations (per s^2), `(samples, n)`. In an array `(..., n)`, every
                vector along the last axis is one sample.
            tau: torques, N m or N, of the shape of `q`.
            armature: also identify the rotors' inertia (keyword only). Otherwise the arm's armature is used.
            friction: also identify damping and Coulomb friction (keyword only). Otherwise the torques must contain no friction.
            offset: also identify a constant torque offset of each joint, such as that of a torque sensor (keyword only). Otherwise an
                offset changes the estimates of gravity.
            noise: standard deviation of the torque of each joint, `(n,)`, N m or N, for weights; equal weights if None (keyword only).
            cutoff: the rank is the number of singular values above this fraction of the largest; 1e-6 if None (keyword only). These are the
                singular values of `W_b` after each column is scaled to unit length.

        Returns:
            An `al.Identification`: `.values`, `.deviations`, `.rank`, `.condition`, `.residuals`, `.unidentified`, `.arm`.

        Raises:
            InputError: an argument is not finite, shapes differ, there are too few samples, or armature, friction or offset is requested
                for `planar_pr`, which has none.

        Source: Gautier and Khalil, Exciting trajectories for the identification of base inertial parameters of robots, IJRR 11(4), 1992.

        >>> import numpy as np
        >>> import armlet as al
        >>> arm = al.planar_arm([1.0, 0.5])
        >>> q, v, a = np.random.default_rng(0).normal(size=(3, 100, 2))
        >>> found = arm.identify(q, v, a, arm.inverse_dynamics(q, v, a))
        >>> np.allclose(found.values, found.base.values)
        True
        """
    def energy(self, q: ArrayLike, v: ArrayLike, *, out: tuple[_Array, _Array] | None = None) -> tuple[_Array, _Array]:
        """The kinetic energy `v' M v / 2` and the potential energy, whose gradient is `g`: two arrays `(...)`, J.

        Args:
            q, v: positions (rad or m) and velocities (rad/s or m/s), `(..., n)`, broadcast over the leading axes.
            out: a tuple of two arrays to write to (keyword only).

        Raises:
            InputError: an argument is not finite or has the wrong shape, or `out` cannot be written.

        >>> import armlet as al
        >>> kinetic, potential = al.planar_pr(2.0, 0.5, 0.5).energy([0.0, 0.0], [1.0, 0.0])
        >>> float(kinetic), float(potential)
        (1.0, 0.0)
        """
    def nearest(self, target: ArrayLike, q: ArrayLike) -> _Array:
        """The position that is the same pose as `target` and nearest to `q`, `(..., n)`: whole turns are added to joints without limits.

        A law computes `target - q` and does not wrap angles. So a continuous joint at 3.13 rad with the target -3.13 rad moves 6.26 rad. With
        the target `nearest([-3.13], [3.13])` it moves 0.023 rad. Joints with limits and joints that slide keep the target. A joint with
        followers turns if each follower turns by a whole number of turns.

        Args:
            target: positions, `(..., n)`, rad or m.
            q: the positions to be near, `(..., n)`, rad or m, broadcast over the leading axes.

        Raises:
            InputError: an argument is not finite or has the wrong shape.

        >>> import armlet as al
        >>> arm = al.planar_arm([1.0, 0.5])
        >>> arm.nearest([-3.13, 0.4], [3.13, 0.2]).round(3)
        array([3.153, 0.4  ])
        """
    def pose(self, q: ArrayLike, frame: str, *, out: _Array | None = None) -> _Array:
        """The pose `X_WF` of a frame, `(..., 4, 4)`: a homogeneous transform, lengths in m.

        Args:
            q: positions, `(..., n)`, rad or m.
            frame: one of `frame_names`.
            out: an array to write to (keyword only).

        Raises:
            InputError: `q` is not finite or has the wrong shape, the frame is unknown, the arm has no links, or `out` cannot be written.

        >>> import armlet as al
        >>> al.planar_arm([1.0]).pose([0.0], "link1")
        array([[1., 0., 0., 1.],
               [0., 1., 0., 0.],
               [0., 0., 1., 0.],
               [0., 0., 0., 1.]])
        """
    def pose_vector(self, q: ArrayLike, frame: str, *, out: _Array | None = None) -> _Array:
        """The pose of a frame as six numbers, `(..., 6)`: its position in m, then its rotation vector `log R` in rad, both in world axes.

        The rotation vector is the rotation axis times the angle in [0, pi]. For the angle pi both signs of the axis are valid. With the
        axes "xyz rx ry rz", the target of a `CartesianImpedance` can be `arm.pose_vector(q, frame)`.

        Args and errors: as for `pose`.

        Source: Shepperd, Quaternion from rotation matrix, Journal of Guidance and Control 1(3), 1978.

        >>> import armlet as al
        >>> al.planar_arm([1.0, 0.5]).pose_vector([0.0, 0.5], "link1").tolist()
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        >>> al.planar_arm([1.0]).pose_vector([0.5], "link1").round(3)
        array([0.878, 0.479, 0.   , 0.   , 0.   , 0.5  ])
        """
    def position(self, q: ArrayLike, frame: str, *, out: _Array | None = None) -> _Array:
        """The position `p_WF` of a frame's origin in the world, `(..., 3)`, m.

        Args and errors: as for `pose`.

        >>> import armlet as al
        >>> al.planar_arm([1.0, 0.5]).position([0.0, 0.0], "link2")
        array([1.5, 0. , 0. ])
        """
    def jacobian(self, q: ArrayLike, frame: str, *, out: _Array | None = None) -> _Array:
        """The geometric Jacobian `J` of a frame, `(..., 6, n)`.

        `J v` is the velocity of the frame's origin in m/s, then the angular velocity in rad/s, both in world axes.

        Args and errors: as for `pose`.

        >>> import armlet as al
        >>> al.planar_arm([1.0]).jacobian([0.0], "link1")[:, 0].tolist()
        [0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
        """
    def jacobian_dot(self, q: ArrayLike, v: ArrayLike, frame: str, *, out: _Array | None = None) -> _Array:
        """The time derivative `dJ/dt` of a frame's Jacobian, `(..., 6, n)`: the frame's acceleration is `J a + dJ/dt v`.

        Args:
            q, v: positions (rad or m) and velocities (rad/s or m/s), `(..., n)`, broadcast over the leading axes.
            frame, out: as for `pose`.

        Raises:
            InputError: as for `pose`.

        >>> import armlet as al
        >>> al.planar_arm([1.0]).jacobian_dot([0.0], [2.0], "link1")[:2, 0].tolist()
        [-2.0, 0.0]
        """
    def center_of_mass(self, q: ArrayLike, *, out: _Array | None = None) -> _Array:
        """The centre of mass of all moving bodies, in the world, `(..., 3)`, m.

        Args:
            q: positions, `(..., n)`, rad or m.
            out: an array to write to (keyword only).

        Raises:
            InputError: `q` is not finite or has the wrong shape, the arm has no links or no mass, or `out` cannot be written.

        >>> import armlet as al
        >>> al.planar_arm([1.0]).center_of_mass([0.0])
        array([0.5, 0. , 0. ])
        """
    def center_of_mass_jacobian(self, q: ArrayLike, *, out: _Array | None = None) -> _Array:
        """The Jacobian `J` of the centre of mass, `(..., 3, n)`: `J v` is the velocity of the centre of mass in world axes, m/s.

        Args and errors: as for `center_of_mass`.

        >>> import armlet as al
        >>> al.planar_arm([1.0]).center_of_mass_jacobian([0.0])[:, 0].tolist()
        [0.0, 0.5, 0.0]
        """
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self, /) -> int: ...
