"""What the simulation parameters are called in XML, by kind: attribute to field of `Parameters`.

These are the names that the simulator announces. Parameter files differ in two of them; see
`ciberrato.files.parameters`.
"""

from __future__ import annotations

INTEGERS = {
    "SimTime": "sim_time",
    "CycleTime": "cycle_time",
    "KeyTime": "key_time",
    "NRequestsPerCycle": "requests_per_cycle",
    "ObstacleLatency": "obstacle_latency",
    "BeaconLatency": "beacon_latency",
    "GroundLatency": "ground_latency",
    "CompassLatency": "compass_latency",
    "CollisionLatency": "collision_latency",
    "ReturnTimePenalty": "return_time_penalty",
    "ArrivalTimePenalty": "arrival_time_penalty",
    "CollisionWallPenalty": "collision_wall_penalty",
    "CollisionRobotPenalty": "collision_robot_penalty",
    "TargetReward": "target_reward",
    "HomeReward": "home_reward",
}
REALS = {
    "CompassNoise": "compass_noise",
    "BeaconNoise": "beacon_noise",
    "ObstacleNoise": "obstacle_noise",
    "MotorsNoise": "motors_noise",
    "GPSLinNoise": "gps_linear_noise",
    "GPSDirNoise": "gps_direction_noise",
    "BeaconAperture": "beacon_aperture",
}
SWITCHES = {
    "GPS": "gps",
    "BeaconSensor": "beacon_sensor",
    "CompassSensor": "compass_sensor",
    "ScoreSensor": "score_sensor",
    "ObstacleRequestable": "obstacle_requestable",
    "BeaconRequestable": "beacon_requestable",
    "GroundRequestable": "ground_requestable",
    "CompassRequestable": "compass_requestable",
    "CollisionRequestable": "collision_requestable",
}
FILE_NAMES = {"Lab": "lab_file", "Grid": "grid_file"}
