"""The controller in Python: `python controller.py PORT RATE SAMPLES OUT` calls the law at every tick of a clock.

It writes the npz archive `OUT`. `late (K,)` is the time at which each cycle began, and `done (K,)` the time at which its command was sent,
both in s after the deadline. `state` is the last state of the robot. The other entries report which permissions the system granted.
"""

import socket
import sys
import time

import numpy as np
from clock import reserve, wait_until
from loop import HOST, START, law, n


def run(port: int, rate: float, samples: int, out: str) -> None:
    permitted = reserve()
    dt = 1.0 / rate
    command, state = np.zeros(1 + n), np.empty(1 + 2 * n)
    late, done = np.zeros(samples), np.zeros(samples)
    estimate = np.zeros(len(law.parameter_names))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as channel:
        channel.settimeout(5.0)
        channel.connect((HOST, port))
        command[0] = START
        channel.send(command)
        begin = time.perf_counter() + 0.05
        for k in range(samples):
            deadline = begin + k * dt
            late[k] = wait_until(deadline)
            channel.recv_into(state)
            q, v = state[1 : 1 + n], state[1 + n :]
            terms = law.terms(k * dt, q, v, state=estimate)
            command[0], command[1:] = k, terms["tau"]
            channel.send(command)
            done[k] = time.perf_counter() - deadline
            estimate += dt * terms["estimate_rate"]
        channel.recv_into(state)
    np.savez(out, late=late, done=done, state=state, **permitted)


if __name__ == "__main__":
    run(int(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]), sys.argv[4])
