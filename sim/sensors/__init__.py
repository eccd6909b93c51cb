"""The simulated sensors, by the topic of what they send. A new one is a file of its own and a line here."""

from collections.abc import Mapping

from sim.sensors.barometer import Barometer
from sim.sensors.contract import Sensor
from sim.sensors.flow_camera import FlowCamera
from sim.sensors.gps import Gps
from sim.sensors.imu import Imu
from sim.sensors.magnetometer import Magnetometer
from sim.sensors.pad_camera import PadCamera
from sim.sensors.sonar import Sonar
from sim.sensors.tachometer import Tachometer

CATALOGUE: Mapping[str, type[Sensor]] = {
    sensor.topic: sensor for sensor in (Imu, Magnetometer, Barometer, Gps, Sonar, Tachometer, PadCamera, FlowCamera)
}
