"""Pages without a browser: NiceGUI's own user, for what a page says and does."""

import asyncio
import gc
import sys
from functools import wraps

from nicegui import Client
from nicegui.testing.user_simulation import user_simulation

from inercal.bench.workbench.bench import open_bench


def of_user(test):
    """A test ``async (user, bench, ...)`` on the pages of a bench in ``tmp_path``."""

    @wraps(test)
    def run(tmp_path, **given):
        async def simulated():
            bench = open_bench(tmp_path / "work", str(tmp_path / "store"))
            try:
                async with user_simulation() as user:
                    from inercal.bench.workbench.pages import add_pages

                    add_pages(bench)
                    try:
                        await test(user, bench, **given)
                    finally:  # what waits for messages may swallow a cancellation (wait_for of Python 3.11), and go on
                        for client in [*Client.instances.values()]:
                            client.outbox.stop()
            finally:
                bench.close()

        gc.collect()
        gc.freeze()  # what is alive now: NiceGUI collects all garbage three times in each test
        ours = {name: module for name, module in sys.modules.items() if name.partition(".")[0] == "inercal"}
        try:
            asyncio.run(simulated())
        finally:  # NiceGUI forgets the modules of pages and all above them: ours would be there twice
            sys.modules.update(ours)

    del run.__wrapped__
    return run
