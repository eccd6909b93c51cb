"""The pad camera's error model against the pinhole, the Cramer-Rao table and its own stated deviations."""

import math

import numpy as np
import pytest

from flightlog.camera import CameraModel
from flightlog.marks import HMark
from flightlog.rotations import matrix, quaternion

# nothing but the white noise of the edges
EDGES_ALONE = {
    "centre_noise": 0.0, "size_noise": 0.0, "angle_noise": 0.0, "tilt_std": 1e-5, "bleed_std": 1e-3,
    "scale_std": 0.0, "detection_share": 1.0, "cut_detection_share": 1.0,
}  # fmt: skip
CLEAN = {**EDGES_ALONE, "edge_noise": 1e-3}


def over(bench, camera_height, **attitude):
    """Body position that puts the level camera at that height."""
    return {"position": (0.0, 0.0, camera_height - bench.vehicle.cameras["down"].mount.position[2]), **attitude}


def look(bench, sensor, **given):
    return next(bench.rest(sensor, 1, **given))


def stated(sample):
    return np.array([sample.std_x, sample.std_y, sample.std_z, sample.std_angle])


@pytest.mark.parametrize(
    ("roll", "pitch", "heading", "position"),
    [(0, 0, 0, (0, 0, 10)), (0.1, -0.05, 0.7, (0.8, -0.5, 8)), (-0.1, 0.12, 4.0, (-0.3, 0.4, 5))],
)
def test_centre_is_the_pinholes_and_the_mark_is_where_the_truth_says(bench, roll, pitch, heading, position):
    mount = bench.vehicle.cameras["down"].mount
    rotation = matrix(quaternion(roll, pitch, heading))
    expected = (rotation @ mount.axes).T @ (-np.array(position, float) - rotation @ mount.position)
    sample = look(bench, bench.build("pad", **CLEAN), position=position, roll=roll, pitch=pitch, heading=heading)
    np.testing.assert_allclose([sample.x, sample.y, sample.z], expected, atol=2e-4)


def test_ahead_is_up_in_the_picture_and_right_is_right(bench):
    sensor = bench.build("pad", **CLEAN)
    # heading north, the pad ahead and to the right: the vehicle south and west of it
    sample = look(bench, sensor, position=(-1.0, -2.0, 10.0))
    assert (sample.x, sample.y) == (pytest.approx(1.0, abs=1e-3), pytest.approx(-2.0, abs=1e-3))


@pytest.mark.parametrize("heading", [0.0, 0.3, -0.3, 1.5, 1.7, 3.5])
@pytest.mark.parametrize("tilt", [0.0, 0.15])
def test_angle_is_the_marks_axis_clockwise_from_level_image_up(bench, heading, tilt):
    sample = look(bench, bench.build("pad", **CLEAN), position=(0.1, 0.2, 9.0), heading=heading, roll=tilt, pitch=-tilt)
    # the mark's axis points north; seen from a nose at `heading` it lies anticlockwise by as much
    assert math.remainder(sample.angle + heading, math.pi) == pytest.approx(0.0, abs=1e-3)
    assert -math.pi / 2 < sample.angle <= math.pi / 2


@pytest.mark.parametrize(
    ("height", "millimetres"), [(2.0, 0.02), (5.12, 0.24), (9.32, 1.1), (10.0, 1.3), (13.52, 2.7), (17.72, 5.3)]
)
def test_whole_mark_reaches_the_cramer_rao_bound(bench, height, millimetres):
    # bound for edges of 0.1 px with the attitude known, computed by another program
    sensor = bench.build("pad", **{**EDGES_ALONE, "edge_noise": 0.1})
    sample = look(bench, sensor, **over(bench, height))
    assert sample.std_z * 1e3 == pytest.approx(millimetres, abs=0.006 if height < 3 else 0.06, rel=0.02)
    if height == 10.0:
        # 0.014 deg for 0.15 px
        assert math.degrees(sample.std_angle) * 1.5 == pytest.approx(0.014, abs=0.001)


@pytest.mark.parametrize(("tilt_std", "bleed_std"), [(1e-5, 1e-3), (0.02, 1e-3), (1e-5, 0.5), (0.02, 0.5)])
def test_stated_deviations_follow_from_the_projection(bench, tilt_std, bleed_std):
    # the same covariance from differences of projected outline points, cut at the picture's border
    noise, camera, mount, mark = 0.1, bench.vehicle.cameras["down"].model, bench.vehicle.cameras["down"].mount, HMark()
    n = bench.numbers("pad")
    roll, pitch, heading, position = 0.05, -0.08, 0.4, np.array([0.15, -0.1, 1.6])
    nuisances = {"tilt_std": tilt_std, "bleed_std": bleed_std}
    sensor = bench.build("pad", **{**EDGES_ALONE, **nuisances, "edge_noise": noise})
    sample = look(bench, sensor, position=position, roll=roll, pitch=pitch, heading=heading)
    assert 0.2 < sample.quality < 0.95  # cut

    corners = mark.outline()
    points, tangents, lengths = [], [], []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        for k in range(200):
            points.append(a + (b - a) * (k + 0.5) / 200)
            tangents.append((b - a) / np.hypot(*(b - a)))
            lengths.append(np.hypot(*(b - a)) / 200)
    points, tangents, lengths = map(np.array, (points, tangents, lengths))
    turn = matrix(quaternion(roll, pitch, heading)) @ mount.axes
    centre = turn.T @ -position - mount.axes.T @ mount.position

    def project(p, where):
        c, s = math.cos(p[3]), math.sin(p[3])  # clockwise seen from above
        ground = np.column_stack([where @ [c, s], where @ [-s, c], np.zeros(len(where))])
        arms = ground @ turn
        return camera.project(centre + p[:3] + arms + np.cross([p[4], p[5], 0.0], arms))

    zero = np.zeros(6)
    pixels = project(zero, points)
    keep = camera.contains(pixels, n["margin"])
    along = (project(zero, points + 1e-5 * tangents) - project(zero, points - 1e-5 * tangents)) / 2e-5
    pitch_px = np.hypot(*along.T)
    normal = np.column_stack([along[:, 1], -along[:, 0]]) / pitch_px[:, None]
    jacobian = np.stack(
        [np.sum(normal * (project(d, points) - project(-d, points)), axis=1) / 2e-6 for d in 1e-6 * np.eye(6)], axis=1
    )
    jacobian = np.column_stack([jacobian, np.ones(len(points))])  # bleed: every edge outward
    weight = (pitch_px * lengths * keep)[:, None]
    prior = np.diag([0.0] * 4 + [tilt_std**-2] * 2 + [bleed_std**-2])
    covariance = np.linalg.inv(jacobian.T @ (weight * jacobian) / noise**2 + prior)[:4, :4]
    assert sample.quality == pytest.approx(lengths[keep].sum() / lengths.sum(), abs=0.02)
    np.testing.assert_allclose(stated(sample), np.sqrt(np.diag(covariance)), rtol=0.06)


@pytest.mark.parametrize("height", [10.0, 1.2])
def test_errors_are_as_large_as_stated(bench, height):
    # normalised squared error of each unknown over flights, everything drawn but the scale: mean 1
    errors = []
    for seed in range(800):
        sensor = bench.build("pad", seed, scale_std=0.0, detection_share=1.0, cut_detection_share=1.0)
        sample = look(bench, sensor, roll=0.06, pitch=-0.04, heading=0.2, **over(bench, height))
        errors.append(np.array(sensor.errors()[:4]) / stated(sample))
    errors = np.array(errors)
    # mean of 800 squares has a deviation of 0.05
    np.testing.assert_allclose(np.mean(errors**2, axis=0), 1.0, atol=0.2)
    assert np.all(np.abs(errors.mean(axis=0)) < 4 / math.sqrt(800))


def test_joint_error_is_distributed_as_chi_square(bench):
    sensor = bench.build("pad", 7, **{**EDGES_ALONE, "edge_noise": 0.2})
    e = []
    for _ in bench.rest(sensor, 4000, **over(bench, 8.0, roll=0.1)):
        e.append(sensor.errors()[:4])
    e = np.array(e)
    nees = np.einsum("ni,ij,nj->n", e, np.linalg.inv(np.cov(e.T)), e)
    assert np.mean(nees) == pytest.approx(4.0, abs=0.05)
    assert np.mean(nees > 13.28) == pytest.approx(0.01, abs=0.006)  # 99 % of 4 degrees of freedom


def test_low_over_the_bar_only_what_is_measured_across_it_stays_sharp(bench):
    # 0.55 m over the centre: the legs are out of the picture, the bar's two edges run across it
    sensor = bench.build("pad", **{**EDGES_ALONE, "edge_noise": 0.1})
    sample = look(bench, sensor, **over(bench, 0.55))
    assert sample.std_y < 1e-3
    assert sample.std_z < 1e-2
    assert sample.std_x > 1.0
    whole = look(bench, sensor, **over(bench, 3.0))
    assert whole.std_x < 1e-3
    # what no edge measures is where the prediction had it, and said to be as good as unknown
    errors = []
    for seed in range(200):
        again = bench.build("pad", seed, **{**EDGES_ALONE, "predicted_std": 0.03})
        look(bench, again, **over(bench, 0.55))
        errors.append(again.errors()[0])
    assert np.std(errors) == pytest.approx(0.03, rel=0.2)
    # turned by a quarter the loss turns with it
    turned = look(bench, sensor, **over(bench, 0.55, heading=math.pi / 2))
    assert turned.std_x < 1e-3
    assert turned.std_y > 1.0


def test_it_is_lost_where_it_must_be(bench):
    sensor = bench.build("pad", detection_share=1.0, cut_detection_share=1.0)
    assert look(bench, sensor, **over(bench, 0.45)) is None  # too near
    assert look(bench, sensor, **over(bench, 90.0)) is None  # too small
    assert look(bench, sensor, position=(8.0, 0.0, 10.0)) is None  # outside the picture
    assert look(bench, sensor, position=(0.0, 0.0, 10.0), roll=math.pi) is None  # upside down
    assert look(bench, sensor, **over(bench, 0.55)) is not None
    assert look(bench, sensor, **over(bench, 20.0)) is not None


def test_visible_share_falls_with_height_over_the_centre(bench):
    sensor = bench.build("pad", **CLEAN)
    shares = [look(bench, sensor, **over(bench, h)).quality for h in (3.0, 1.7, 1.4, 1.2, 1.0, 0.8, 0.6)]
    assert shares[0] == 1.0
    assert shares[-1] < 0.4
    assert np.all(np.diff(shares) <= 0.0)


def test_detections_come_at_their_share(bench):
    found = [s is not None for s in bench.rest(bench.build("pad", 1, detection_share=0.9), 4000)]
    assert np.mean(found) == pytest.approx(0.9, abs=0.02)
    cut = bench.build("pad", 1, detection_share=1.0, cut_detection_share=0.6)
    assert np.mean([s is not None for s in bench.rest(cut, 4000, **over(bench, 1.2))]) == pytest.approx(0.6, abs=0.03)


def test_scale_is_drawn_per_flight_and_moves_the_mark_along_its_ray(bench):
    std = bench.numbers("pad")["scale_std"]
    heights, rays = [], []
    for seed in range(500):
        sensor = bench.build("pad", seed, **{**CLEAN, "scale_std": std})
        sample = look(bench, sensor, position=(1.0, 1.0, 9.9))
        heights.append(sample.z / 9.8)
        rays.append([sample.x / sample.z, sample.y / sample.z])
    assert np.std(heights) == pytest.approx(std, rel=0.15)
    assert np.ptp(rays, axis=0).max() < 1e-4


def test_it_is_late_by_the_cameras_latency_and_an_unknown_delay(bench, truth):
    sensor = bench.build("pad", **{**CLEAN, "delay": 0.03, "latency": 0.06})
    sample = sensor.sample(truth(2.0))
    assert (sample.t, sample.t_arrival) == pytest.approx((2.03, 2.09))


def test_a_finer_camera_sees_more(bench):
    noisy = {**EDGES_ALONE, "edge_noise": 0.12}  # so much that nothing else counts
    coarse, fine = bench.build("pad", **noisy), bench.build("pad", **noisy)
    model = CameraModel.centred(1536, 988, 2 * 952.4, 2 * 816.3)
    fine._intrinsics = np.array([model.width, model.height, model.fx, model.fy, model.cx, model.cy])
    a, b = look(bench, coarse), look(bench, fine)
    # twice the pixels an edge, each half as large: 2^1.5
    assert a.std_z / b.std_z == pytest.approx(2**1.5, rel=0.01)
