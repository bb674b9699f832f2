"""The robot: `python robot.py RATE` simulates the arm behind a loopback socket until it is terminated.

It prints its port number. Each command advances the simulated time by one sample, independent of the clock. So a late controller does not
change the results.
"""

import socket
import sys

import numpy as np
from loop import HOST, START, n, plant, q0

import armlet as al


def serve(rate: float) -> None:
    robot = al.Simulator(plant, None, q0, dt=1.0 / rate, check_limits=False)
    command, state = np.empty(1 + n), np.empty(1 + 2 * n)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as channel:
        channel.bind((HOST, 0))
        print(channel.getsockname()[1], flush=True)
        while True:
            size, sender = channel.recvfrom_into(command)
            if size != command.nbytes:
                continue
            if command[0] == START:
                robot.reset()
            else:
                robot.step(command[1:])
            state[0] = command[0] + 1.0
            state[1 : 1 + n], state[1 + n :] = robot.q, robot.v
            channel.sendto(state, sender)


if __name__ == "__main__":
    serve(float(sys.argv[1]))
