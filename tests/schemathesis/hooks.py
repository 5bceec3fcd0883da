"""What is sent, made to mean something more often: claims that do not wait, and scenarios that are some."""

import schemathesis

SCENARIO = {
    "experiment": "hopper",
    "product": {"count": 6, "subparticle_radius_m": 0.008},
    "numerics": {"timestep_s": "auto"},
}
FACTORS = [{"pointer": "/equipment/belt_speed_m_s", "levels": [0.2, 0.3]}]


@schemathesis.hook
def before_call(context, case, kwargs):
    body = case.body
    if not isinstance(body, dict):
        return
    wait = body.get("wait_s")
    if isinstance(wait, (int, float)) and wait > 0.1:
        body["wait_s"] = 0.1
    # In place of an object that has no field: every other one stays as it is.
    if body.get("scenario") == {}:
        body["scenario"] = SCENARIO
    if body.get("base") == {}:
        body["base"] = SCENARIO
        if isinstance(body.get("design"), dict):
            body["design"] = {"kind": "grid"}
            body["factors"] = FACTORS
