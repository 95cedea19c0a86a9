"""What users type in Python: meant values are taken, others refused in a sentence.

The calls run in one process of their own, without the checks of annotations that tests switch on,
which would refuse wrong types before geneoh does.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
CALLS = {
    # What is given to denoise
    "denoise(NOISY, obj=OBJ, **FAST)": "Denoised",
    "denoise(Path(NOISY), FAST_OPTIONS, obj=[OBJ])": "Denoised",
    "denoise(SHORT, preset='fast', steps=1, seed=numpy.int64(3))": "Denoised",
    "denoise(SHORT, FAST_OPTIONS, seed=7).options.seed": "int",
    "denoise(JOINTS)": "geneoh.from_arrays makes a Sequence of arrays",
    "denoise(JOINTS.numpy())": "takes a Sequence or the npz file of one, got ndarray",
    "denoise({'right_joints': JOINTS})": "takes a Sequence or the npz file of one, got dict",
    "denoise(None)": "takes a Sequence or the npz file of one, got NoneType",
    "denoise('missing.npz')": "missing.npz: ",
    "denoise(SHORT, 'fast')": "settings go by name, such as",
    "denoise(SHORT, preset='turbo')": "'preset' must be one of 'default', 'paper', 'fast'",
    "denoise(SHORT, presett='fast')": "did you mean 'preset'?",
    "denoise('missing.npz', side='left')": "geneoh.load(path, side=...) makes the sequence with it",
    "denoise(SHORT, seed=-1)": "'seed' must be 0 to 9223372036854775807, got -1",
    "denoise(SHORT, seed=1.5)": "'seed' must be a whole number, got 1.5",
    "denoise(SHORT, samples=0)": "Options: 'samples' must be 1 or more, got 0",
    "denoise(SHORT, device='gpu')": "expected a device of this machine",
    "Options(device=torch.device('cpu'))": "Options",
    # Tracks, objects and sequences that are made by hand
    "clean(HandTrack('left', VALID, joints=JOINTS.numpy()))": "Denoised",
    "clean(HandTrack('left', VALID.tolist(), joints=JOINTS.tolist()))": "Denoised",
    "clean(HandTrack('left', VALID.int(), joints=JOINTS.double()))": "Denoised",
    "clean(HandTrack('left', VALID, joints=JOINTS.half()))": "Denoised",
    "HandTrack('Left', VALID, joints=JOINTS)": "side must be 'left' or 'right', got 'Left'",
    "HandTrack('left', VALID, joints=JOINTS.flatten(1))": (
        "'joints' must be numbers of shape (T, 21, 3) with T = 6, got (6, 63)"
    ),
    "HandTrack('left', VALID, joints='joints.npy')": "(T, 21, 3) with T = 6, got str",
    "HandTrack('left', VALID, joints=JOINTS.numpy().astype(object))": (
        "got an array of objects; make numbers of it with astype(float)"
    ),
    "HandTrack('left', VALID, joints=[[1, 2], [3]])": "(T, 21, 3) with T = 6, got list",
    "HandTrack('left', VALID[:3], joints=JOINTS)": "(T, 21, 3) with T = 3, got (6, 21, 3)",
    "HandTrack('left', None, joints=JOINTS)": "'valid' must be numbers of shape (T,), got NoneType",
    "HandTrack('left', VALID, pose=numpy.zeros((6, 48)), wrist=JOINTS[:, 0])": "(T, 16, 3)",
    "clean(HandTrack('left', VALID, joints=JOINTS * torch.nan))": "must be finite wherever",
    "clean(motion=ObjectTrack(OBJ, TURN.numpy(), SHIFT.double()))": "Denoised",
    "clean(motion=ObjectTrack([MESH], TURN[:, 0], SHIFT[:, 0]))": "Denoised",
    "ObjectTrack(MESH, torch.zeros(6, 1, 3), SHIFT)": "'rotation' must be numbers of shape",
    "ObjectTrack([JOINTS], TURN, SHIFT)": "geneoh.Mesh(vertices, faces) makes one of arrays",
    "clean(motion=ObjectTrack(Mesh(MESH.verts.numpy(), MESH.faces.int()), TURN, SHIFT))": (
        "Denoised"
    ),
    "Mesh(MESH.verts, [[0, 1, 2, 3]])": "'faces' must be numbers of shape (F, 3) with F = 1",
    "clean(motion=ObjectTrack(Mesh([[0, 0, 0]], numpy.zeros((0, 3), int)), TURN, SHIFT))": (
        "got 1 vertices and no face"
    ),
    "denoise(Sequence(HAND, MOTION, numpy.float32(30)), **FAST)": "Denoised",
    "denoise(Sequence([HAND], MOTION, '30'), **FAST)": "Denoised",
    "Sequence(HAND, MOTION, None)": "'fps' must be a number, got None",
    "Sequence((JOINTS,), MOTION, 30)": "made of HandTracks and an ObjectTrack, got Tensor",
    "Sequence(HAND, None, 30)": "made of HandTracks and an ObjectTrack, got HandTrack, NoneType",
    "from_arrays(fps=30, right_joints=JOINTS, meshes=None)": "Sequence",
    "from_arrays(fps=30, right_joints=JOINTS, meshes=5)": "Mesh or the path of its file, got int",
    "clean(motion=ObjectTrack(TRIMESH, TURN, SHIFT))": "Denoised",
    "load(NOISY, obj=[TRIMESH])": "Sequence",
    # Files
    "load(NOISY, obj=MESH)": "Sequence",
    "load(NOISY, obj=(Path(OBJ),))": "Sequence",
    "load(JOINTS)": "'path' must be a path or text, got tensor",
    "load(None)": "'path' must be a path or text, got None",
    "load(NOISY, side='Left')": "'side' must be one of 'left', 'right' or none, got 'Left'",
    "load(NOISY, fps='30')": "'fps' must be a number or none, got '30'",
    "load(NOISY, unit='inch')": "'unit' must be one of 'mm', 'cm', 'm', got 'inch'",
    "load(NOISY, joint_order='smpl')": "'joint_order' must be one of 'openpose'",
    "load(OBJ, obj=NOISY)": "expected a mesh file",
    "load_mesh(None)": "'path' must be a path or text",
    "load_mesh(OBJ, 'inch')": "'unit' must be one of",
    "read(NOISY, 'keypoints')": "expected one of grab",
    "read('keypoints', NOISY, side='Left')": "'side' must be one of",
    "from_arrays(right_joints='x.npy', fps=30)": "'right_joints' must be an array of numbers",
    "from_arrays(right_joints=JOINTS, fps=numpy.float32(30))": "Sequence",
    "from_arrays(right_joints=JOINTS, fps=numpy.int64(30))": "Sequence",
    "from_arrays(right_joints=JOINTS, fps=numpy.array(30.0))": "Sequence",
    "from_arrays(right_joints=JOINTS, fps=torch.tensor(30))": "Sequence",
    "from_arrays(right_joints=JOINTS, fps=fractions.Fraction(30000, 1001))": "Sequence",
    "from_arrays(right_joints=JOINTS, fps=True)": "'fps' must be a number",
    "from_arrays(right_joints=JOINTS, fps=numpy.zeros(1))": "'fps' must be a number",
    "read('keypoints', POINTS, side='right', fps=numpy.float32(30))": "Sequence",
    "load(POINTS, side='right', fps=numpy.array(30))": "Sequence",
    "from_arrays(right_joints=JOINTS.numpy().astype(object), fps=30)": (
        "got (6, 21, 3) of object; make numbers of it with astype(float)"
    ),
    "from_arrays(right_joints=[[1, 2], [3]], fps=30)": "'right_joints' must be an array of numbers",
    "from_arrays(right_joints=JOINTS, fps='fast')": "'fps' must be a number",
    "clean(HandTrack('left', VALID, numpy.ma.masked_less(JOINTS.numpy(), 0)))": "got NaN",
    "HandTrack('left', numpy.ma.masked_less(range(6), 1) > 0, JOINTS).valid[0].item() or SHORT": (
        "Sequence"
    ),
    "save(JOINTS, 'out.npz')": "takes a result or a Sequence, then the path",
    "read('keypoints', POINTS, side='right', fps=30, camera='origin')": "Sequence",
    "load(POINTS, side='right', fps=30, camera='origin')": "Sequence",
    "read('keypoints', POINTS, sied='left')": "geneoh.read: 'sied' is no option; did you mean 's",
    "read('keypoints', POINTS, meshes=OBJ)": "'meshes' is no option",
    "denoise(SHORT, on_progress=True)": "'on_progress' must be a function or none, got True",
    "view(GENERATED, folder / 'out.png', frames=[0], cell=64)": "PosixPath",
    "view(JOINTS, 'out.png')": "got Tensor; geneoh.from_arrays makes a Sequence of arrays",
    "view(SHORT, 'out.png', before=JOINTS.numpy())": "'before' must be a result, a Sequence or",
    "Stream(OBJ, numpy.float32(30), numpy.float16(0), side='left').push(HAND[:1])": "CleanFrame",
    "view(SHORT, folder / 'out.html', cell=64)": "'cell' needs a filmstrip, NAME.png; leave it out",
    "view(SHORT, folder / 'out.npz', colouring='contact')": "'colouring' needs a picture or a film",
    "typing.get_type_hints(to_smplx)['side']": "_LiteralGenericAlias",
    "clean(HandTrack('left', VALID, joints=JOINTS.numpy().astype('>f4')))": "Denoised",
    "view(SHORT, 'out.png', frames=3)": "'frames' must be a list of a whole number, got 3",
    "view(SHORT, folder / 'out.png', frames=numpy.arange(2), cell=64)": "PosixPath",
    "evaluate(None, 'scores')": "geneoh.evaluate: 'options' must be geneoh.EvaluationOptions",
    "evaluate({'dataset': 'grab'}, 'scores')": "must be geneoh.EvaluationOptions, got {",
    "evaluate('synthetic', 3)": "geneoh.evaluate: 'folder' must be a path or text, got 3",
    "evaluate('synthetic', 'scores', jobs='2')": "'jobs' must be a whole number, got '2'",
    "generate(3, OBJ)": "geneoh.generate: 'sentence' must be text, got 3",
    "generate('lift the mug', 3)": "Mesh or the path of its file, got int",
    "generate('lift the mug', OBJ, {'frames': 20})": "must be geneoh.GenerateOptions, got {",
    "generate('lift the mug', OBJ, frames=20)": (
        "geneoh.generate: 'frames' is no argument; it is a setting, for "
        "options=geneoh.GenerateOptions(frames=...)"
    ),
    "generate_on_body('wave', 'walk.npz', hold=MOTION)": "'hold' is no argument; did you mean 'h",
    "generate_on_body('wave', {})": "takes a sentence, then a body or its file, got dict",
    "generate_on_body('wave', 'walk.npz', {'seed': 1})": "must be geneoh.BodyOptions, got {",
    "generate_on_body('wave', 'walk.npz', held=3)": "'held' must be an ObjectTrack or none",
    "save('out.npz', SHORT)": "'path' must be a path or text, got Sequence",
    "save(SHORT, folder / 'out.obj')": "expected .npz, got '.obj'; name it so",
    "view(SHORT, 'out.png', colouring='red')": "'colouring' must be one of",
    "to_smplx('Left', SHORT)": "'side' must be one of",
    "to_smplx('left', JOINTS)": "takes a side, then a Sequence, got Tensor",
}
"""Each call with what it returns, or with words of the sentence that refuses it."""
MODES = {
    "inference mode": "with torch.inference_mode(): made = denoise(load(NOISY)[:6], **FAST)",
    "no_grad": "with torch.no_grad(): made = denoise(SHORT, **FAST)",
    "gradients": "made = denoise(SHORT.map(needing_gradients), **FAST)",
    "another default dtype": """
torch.set_default_dtype(torch.float64)
made = denoise(load(NOISY)[:6], **FAST)
assert torch.get_default_dtype() == torch.float64
torch.set_default_dtype(torch.float32)
""",
}
SETUP = """
import fractions, json, logging, random, sys, traceback, typing
from pathlib import Path
import numpy, torch, trimesh
from geneoh import *
from geneoh.errors import GeneOHError
from geneoh.generators.text2hoi.sentences.prompt import read_prompt

logging.disable(logging.CRITICAL)
torch.set_num_threads(1)
folder, calls, modes = Path(sys.argv[1]), json.loads(sys.argv[2]), json.loads(sys.argv[3])
OBJ = "examples/taco_object.obj"
FAST = {"preset": "fast", "steps": 1}
FAST_OPTIONS = Options(**FAST)
NOISY = str(folder / "noisy.npz")
save(load("examples/taco_noisy.npz", obj=OBJ)[:6], NOISY)
SHORT = load(NOISY, obj=OBJ)
(HAND,), MOTION = SHORT.hands, SHORT.object
JOINTS, VALID, (MESH,) = HAND.joints, HAND.valid, MOTION.meshes
TURN, SHIFT = MOTION.rotation, MOTION.translation

POINTS = folder / "points.npy"
numpy.save(POINTS, JOINTS.numpy())
TRIMESH = trimesh.Trimesh(MESH.verts.numpy(), MESH.faces.numpy(), process=False)

GENERATED = Generated(SHORT, torch.zeros(3), read_prompt('lift it'), None)

def clean(hand=HAND, motion=MOTION):
    return denoise(Sequence((hand,), motion, 30.0), **FAST)

def needing_gradients(values):
    return values.clone().requires_grad_() if values.is_floating_point() else values

def state():
    return torch.get_rng_state().tolist(), str(numpy.random.get_state()), random.getstate()

def outcome(call):
    try:
        return type(eval(call)).__name__
    except GeneOHError as error:
        return str(error)
    except Exception:
        return "TRACEBACK " + traceback.format_exc()

said = {call: outcome(call) for call in calls}
plain, before = denoise(SHORT, **FAST).sequence.hands, state()
for name, lines in modes.items():
    try:
        exec(lines)
        hands = zip(made.sequence.hands, plain)
        same = [h.joints.equal(p.joints) for h, p in hands]
        said[name] = f"equal {same}, random state kept {state() == before}"
    except Exception:
        said[name] = "TRACEBACK " + traceback.format_exc()
(folder / "said.json").write_text(json.dumps(said))
"""


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    """What each call returned or raised."""
    folder = tmp_path_factory.mktemp("calls")
    arguments = [str(folder), json.dumps(list(CALLS)), json.dumps(MODES)]
    script = [sys.executable, "-W", "ignore", "-c", SETUP, *arguments]
    child = subprocess.run(script, cwd=ROOT, timeout=900, capture_output=True, text=True)
    assert child.returncode == 0, child.stderr
    return json.loads((folder / "said.json").read_text())


@pytest.mark.slow
@pytest.mark.parametrize("call", CALLS)
def test_a_call_does_what_is_meant_or_says_what_is_wrong(said, call):
    expected = CALLS[call]
    assert said[call] == expected if expected.isidentifier() else expected in said[call]
    assert "TRACEBACK" not in said[call]


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_modes_of_the_caller_change_nothing_and_are_kept(said, mode):
    assert said[mode] == "equal [True], random state kept True"
