"""The tuned numbers of all diagnoses, with unit, meaning and how each was chosen.

Each was set by hand, so that the faults of `tests/benchmarks/bench_suspicions.py` are named on
robots of three to six joints, and nothing is said of recordings without a fault. Those of trials
and flights come from practice: what recorders, drives and aircraft do.

A bracket at the end tells how far a number may change alone: the tried factors (0.5, 0.75, 1.33, 2)
between which no verdict changes on 52 recordings, "tight" for none. 49 of them are simulated, 45
with a fault; 3 are of real robots. Numbers without a bracket were not tried.
"""

# --- the recording alone ---------------------------------------------------------------------

UNEVEN_STEP = 0.1  # [-] deviation of a step over the usual one [0.5-2]
UNEVEN_SHARE = 0.02  # [-] share of uneven steps [0.5-2]
SMOOTHER = 0.7  # [-] roughness over an even clock over that over the recorded times [0.5-2]
CHANCE_SHARE = 0.005  # [-] share of samples that are repeated, missing or clipped by chance [0.5-2]
MIN_REPEATED_ROWS = 5  # [samples] repeated rows of a finding [0.5-2]
HELD_SHARE = 1 / 3  # [-] share of repeated rows above which all are [0.5-2]
RESOLVED = 3.0  # [increments] motion in a sample that an encoder resolves [0.5-2]
FROZEN_TIME = 0.1  # [s] duration of a frozen signal [0.5-2]
MIN_FROZEN_ROWS = 5  # [samples] [0.5-2]
JUMP = 3.0  # [-] step after a frozen signal over usual steps
MOVING = 0.1  # [-] speed over the largest one [0.5-2]
EDGE = 0.01  # [-] distance from the largest torque over the range of torques [0.5-2]
PILE = 5.0  # [-] samples at the largest torque over those within EDGE of it [0.5-2]
MIN_CLIPPED_ROWS = 3  # [samples] [0.5-2]
BEYOND = 5.0  # [-] value over its limit [tight]
FAR_BETTER = 1.0  # [-] logarithm of the ratio of residuals of two meanings of positions
AS_GOOD = 0.3  # [-] of equally likely ones
SPEED_LIMIT = 5.0  # [rad/s] without a limit in the file [0.5-2]
AT_LIMIT = 0.98  # [-] torque over its limit [tight]
OFTEN = 0.01  # [-] share of time there [0.5-2]
CORRELATED = 0.5  # [-] squared correlation of a speed and the derivative of its position [0.5-1.33]
SAME_RATIO = 0.3  # [-] relative difference of a ratio from an expected one [0.75-1.33]
SAME_FACTOR = 0.05  # [-] relative difference of equal ratios [0.5-2]
MIN_SPEED_DELAY_SAMPLES = 0.6  # [samples] [0.5-2]
SAME_DELAY = 0.5  # [-] relative difference of the delays of speeds [0.5-2]
SPEED_WINDOW = 0.2  # [s] longest delay of speeds [0.75-2]
SPIKE_WINDOW = 7  # [samples] of the median; a spike has at most three
SPIKE = 8.0  # [-] distance from the median over nearly all steps from sample to sample
USUAL_STEPS = 0.95  # [-] share of these steps

# --- units and columns, by the robot's links ---------------------------------------------------

FRICTION_WIDTHS = (0.02, 0.1)  # [-] sign changes of any friction over the largest speed [0.5-1.33]
ALIKE = 0.8  # [-] correlation of measured and file's torque, for a joint to show the unit [0.75-1]
WRONG_LINKS = 3.0  # [-] ratio that wrong links of a file may cause [1-2]
LINK_ERRORS = 0.3  # [-] error of the file's torque over that of typical links; see `units`
SIZE_SIGMAS = 2.5  # [-] spreads of a ratio that links cannot explain
UNIT_GAIN = 8.0  # [-] squared distance by which a unit is closer than N m
UNIT_TIE = 4.0  # [-] squared distance by which the best unit is closer than others
SAME_UNIT = 1.6  # [-] ratio between joints with the same unit [0.75-2]
MIN_GEAR = 3.0  # [-] gear ratio that wrong links cannot explain [0.5-2]
PEAKS = (0.8, 4.5)  # [-] largest torque over the rated torque, range of usual motors [1-2]
READING_ROWS = 400  # [samples] compared [0.5-2]
ORDER_ROWS = 100  # [samples] compared for each order of columns
RESIDUAL_FLOOR = 0.03  # [-] residual that remains in any case, over the torque [0.5-1.33]
MIN_RESIDUAL = 0.5  # [-] share of the torque that the file's links leave, for a try [0.5-1.33]
MIN_SCORE = 2.0  # [-] logarithm of the ratio of residuals; see `better_readings` [0.5-1.33]
MIN_FREE_SCORE = 0.5  # [-] [0.5-2]
MAX_FREE_LOSS = 0.1  # [-] loss of score with the best links over the gain with those of the file
LOOSER = 30.0  # [-] deviations of links from the file that may explain torques before a unit does
FIXED = 1e-3  # [-] deviations of links that stay as in the file, beside a tool
MIN_FILE_SCORE = 4.0  # [-] [tight]
MAX_BEHIND = 0.5  # [-] score; readings this close to the best are reported, too [0.5-2]
SCORE_SIGMAS = 3.0  # [-] standard errors of a score [0.5-2]
MIN_TILT = 3.0  # [deg] between two directions of gravity, or two zeros of a position [0.5-2]
MIN_ZERO_RESIDUAL = 0.1  # [-] share of the torque that the file's links leave, for other zeros
MIN_ZERO_SCORE = 1.0  # [-] logarithm of the ratio of residuals with the file's links
MIN_ZERO_GAIN = 0.1  # [-] that of a joint's residual
READING_ROUNDS = 3  # iterations of the weights [0.5-1.33]

# --- what a fit leaves -------------------------------------------------------------------------

BLOCKS = 10  # blocks of time, for standard errors [0.5-2]
RANK = 1e-7  # [-] relative size of independent columns [0.5-2]
SIGN_WIDTH = 0.05  # [-] speed over which friction changes its sign, over the largest speed [1-2]
MOVES_SHARE = 0.05  # [-] share of time in which a joint moves, else it stands still [0.5-2]
MIN_MOVING_ROWS = 50  # [samples] [0.5-2]
DELAY_SIGMAS = 5.0  # [-] standard errors of a reported delay [0.5-2]
AGREE_SIGMAS = 4.0  # [-] standard errors between the delay of a joint and the common one [0.5-1.33]
OWN_SIGMAS = 3.0  # [-] standard errors of a joint's own delay [0.5-2]
MIN_DELAY = 2e-3  # [s] [0.5-2]
MIN_DELAY_GAIN = 0.01  # [-] share of the squared residual that a reported delay explains [0.5-2]
DELAY_ROUNDS = 4  # iterations of the delay [0.5-2]
AT_BOUND = 0.95  # [-] delay over the longest one that is found, for it to be none
MAX_DELAY = 0.35  # [periods of the cut-off] a gradient finds no longer delay [0.5-2]
DELAYS_AGREE = 0.7  # [-] difference between delays of joints that agree, over the delay [0.5-1.33]
LITTLE_LEFT = 0.03  # [-] residual over the torque [0.75-1.33]
SOME_LEFT = 0.06  # [-] [0.75-2]
MUCH_LEFT = 0.3  # [-] [tight]
CAUSE_EXPLAINS = 0.6  # [-] share of the squared residual [tight]
CAUSE_EXPLAINS_LITTLE = 0.75  # [-] of a small one [tight]
AS_LIKELY = 0.12  # [-] difference of similar shares [0.5-2]
LATE = 0.25  # [-] share of the squared residual by a significant delay [0.5-2]
BUILT_UP = (0.003, 0.01, 0.03)  # [-] angle over which friction builds up, over the joint's range
FAR = 2.0  # [-] held-out residual over the fitted one
FAR_BY = 0.05  # [-] more of a torque
HELD_OUT_EXPLAINED = 0.8  # [-] share of the squared residual
DRIVING = 0.1  # [-] friction that drives, over the torque
DRIVING_SIGMAS = 4.0  # [-]
RUBS = 1e-3  # [-] friction of a geared motor over its limit
FAINT = 0.01  # [-] friction over the motor's limit, over the least of the other joints
WORSE = 1.15  # [-] residual of consistent links over that without
WORSE_BY = 0.01  # [-] more of a torque
ELSE = 2.0  # [-] residual of consistent links over that without, where something else acts
ELSE_BY = 0.1  # [-] of the torque
WEAK = 0.5  # [-] standard deviation of a parameter over its prior one, if hardly excited
MAX_CONDITION = 300.0  # [-] condition number of sufficient excitation

# --- what a simulation leaves ------------------------------------------------------------------

EXPLAINED_SHARE = 0.99  # [-] share of a mean square from which the simulation counts as complete
ROUND_OFF = 1e-9  # [-] RMS below which a joint's recording is zero, over the largest joint's RMS
CLEAR_SHARE = 0.02  # [-] share of the mean square by which another case must explain more
MAX_LACKING = 2.0  # [-] largest torque that the plant may lack, over the motor's limit
UNSATURATED = 0.95  # [-] share of the available torque below which a motor is not at its limit

# --- repeated trials of a motion -----------------------------------------------------------------

MAX_GAP = 2.5  # [samples] between two samples
MIN_SAMPLES = 4  # [samples] in a period of the bandwidth
MIN_RECORDED = 0.5  # [-] share of the motion's duration that a recording must last
STANDS = 1e-6  # [rad/s] speed below which a joint of the motion stands
MAX_REFERENCE_ERROR = 1e-3  # [rad] between a recorded reference and the known one
MAX_RANGE_SHARE = 0.1  # [-] RMS position error over the joint's range, plus
MAX_ANGLE = 0.02  # [rad]
MAX_SPEED_SHARE = 0.3  # [-] RMS speed error over the RMS speed, plus
MAX_SPEED_ERROR = 0.02  # [rad/s]
MAX_GROWTH = 1.05  # [-] error over that of the best trial
MIN_GAIN = 0.05  # [-] share of the error that a trial must remove for another one
MIN_STEP = 0.5  # [-] share of a step; limits that allow less end the learning

# --- flights of aircraft -------------------------------------------------------------------------

LEAST_G = 0.5  # [G] that nine tenths of a flight are above
MOST_G = 2.5  # [G] that half of a flight is below
LEVEL_G = 1.3  # [G] that a fiftieth of a long pull is below, as it begins and ends level
ONE_DIRECTION = 0.5  # [-] mean force over mean size of the force
MAX_RATE = 6.283185307179586  # [rad/s] largest angular rate
MAX_MEAN_RATE = 1.0  # [rad/s] mean angular rate

# --- rates of a flight -----------------------------------------------------------------------

TURNING = 0.02  # [rad/s] RMS turning of the vertical that can be compared with rates
EXPLAINED = 0.4  # [-] share of it that rates may leave unexplained
FAR_LESS = 0.5  # [-] of what another reading leaves
PULLED = 1.0  # [m/s²] deviation of a normal force in manoeuvres, and of 30 m/s times the pitch rate
OPPOSED = 0.6  # [-] correlation of force and pitch rate with the wrong sign
