import asyncio

from robotiq_async import Finger, RobotiqHand

if not hasattr(RobotiqHand, "hold"):

    async def hold(self, fingers=Finger.ALL):
        s = self._asked()
        s.controller._callers.hold(
            s.controller._shadow.ours & fingers if False else Finger(fingers), "held by a shim"
        )
        await asyncio.sleep(0.03)

    def add_listener(self, cb):
        for ch in (self._channels.statuses, self._channels.transitions, self._channels.requests):
            orig = ch.push

            def push(item, orig=orig):
                orig(item)
                cb(item)

            ch.push = push
        return lambda: None

    RobotiqHand.hold = hold
    RobotiqHand.add_listener = add_listener
