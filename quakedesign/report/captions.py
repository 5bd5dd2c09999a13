"""What every figure shows, in words: below it in the report, and for readers who do not see it."""

CAPTIONS = {
    "uncontrolled": "Without control: slip, with the slip at which the statics let the fault rest, and slip rate of "
    "the natural earthquake.",
    "cycle": "Without control, loaded from afar at the reference rate of the law: slip and slip rate; dotted: the "
    "loading rate.",
    "slow-sliding": "Held in slow sliding under the stress that the guarantee allows, as a sine: slip and its "
    "reference, slip rate with what it never exceeds, fluid pressure in the fault, and state of friction over that of "
    "steady sliding.",
    "sliding-errors": "How far slip and slip rate are from their references in that run.",
    "states": "Closed loop: slip and its reference on top, then the band that the slip rate of every law fills. The "
    "scale is linear near the reference rate and logarithmic beyond; dashed: the peak of the natural earthquake.",
    "pressure": "Fluid pressure that every law asks for; below zero fluid is withdrawn.",
    "errors": "How far slip and slip rate are from their references, the largest of every 40 kept samples. Lower is "
    "better.",
    "metrics": "Largest errors, root mean square and total variation of the pressure after a quarter of the task. "
    "Hatched: published gains.",
    "friction-law": "Friction coefficient over slip, and the line along which the spring unloads: where friction falls "
    "faster than the spring, the fault is unstable.",
    "earthquakes": "Natural earthquake and the one that a constant injection induces.",
    "friction-coefficient": "Friction coefficient in closed loop between its smallest and largest value.",
    "errors-and-power": "Errors and pressure over those of the e-LQR; bars to the left of one are better.",
    "peak-against-tracking": "What tracking costs: errors that were seen over the peak that is guaranteed, one point a "
    "design.",
}
