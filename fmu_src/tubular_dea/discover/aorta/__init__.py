"""The loop on measured aortic flow and pressure: what a windkessel of three elements lacks.

There is no noise floor to reach here: every windkessel leaves a residual that is the arteries' own (waves), far above
the sensors' noise. So an effect is accepted for what it takes away, in every record and at its held-out end
(`search`), and what is left is reported beside the sensor's noise, not explained.
"""
