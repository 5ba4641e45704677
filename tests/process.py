"""How every test starts a program: with a limit of processor time, which another job on the machine does not use up.

A program that loops is ended by the kernel (SIGXCPU) after `cpu` seconds of its own; one that waits for what never comes, after
WALL seconds, which is long enough for the busiest machine.
"""
import resource
import subprocess

CPU = 300       # seconds of user and system time, all threads together
WALL = 1800     # seconds by the clock


class Process(subprocess.Popen):
    """As subprocess.Popen; communicate() and wait() give up after WALL seconds unless another limit is named."""

    def __init__(self, args, *, cpu=CPU, **kw):
        super().__init__(args if isinstance(args, str) else [str(a) for a in args], **kw)
        try:
            resource.prlimit(self.pid, resource.RLIMIT_CPU, (cpu, cpu + 5))
        except (ProcessLookupError, PermissionError):
            pass                        # it has ended already

    def communicate(self, input=None, timeout=WALL):
        return super().communicate(input, timeout)

    def wait(self, timeout=WALL):
        return super().wait(timeout)


def execute(args, *, input=None, capture_output=False, check=False, cpu=CPU, **kw):
    """As subprocess.run, in a Process."""
    if input is not None:
        kw["stdin"] = subprocess.PIPE
    if capture_output:
        kw["stdout"] = kw["stderr"] = subprocess.PIPE
    with Process(args, cpu=cpu, **kw) as p:
        try:
            out, err = p.communicate(input)
        except BaseException:
            p.kill()
            raise
    done = subprocess.CompletedProcess(p.args, p.returncode, out, err)
    if check:
        done.check_returncode()
    return done
