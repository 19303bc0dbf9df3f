// What `/api/state` says, as service/view/state.py has it. Written by tests/service/view/test_page_types.py.

interface AircraftState {
  name: string;
  colour: number;
  state:
    | "WAITING"
    | "READY"
    | "TAKEOFF"
    | "SEARCHING"
    | "CONFIRMING"
    | "FOUND"
    | "HOLDING"
    | "YIELDED"
    | "RETURNING"
    | "GROUNDED"
    | "DONE"
    | "ABORTED";
  words: string;
  why: string;
  orders: string[];
  lat: number | null;
  lon: number | null;
  height: number | null;
  heading_deg: number | null;
  battery: number | null;
  link: LinkState | null;
  mode: string | null;
  next: NextState;
  ahead: [number, number][];
  steps: number;
  flight_time_s: number;
  sorties: SortieState[];
  pose: PoseState | null;
  footprint: FootprintState;
}

interface BatteryState {
  voltage_v: number | null;
  current_a: number | null;
  consumed_mah: number | null;
}

interface ChoiceState {
  name: string;
  distance_m: number | null;
  probability: number | null;
  chosen: boolean;
}

interface DetectorState {
  silent_s: number | null;
  silent: boolean;
}

interface DrawnState {
  number: number;
  words: string | null;
}

interface EllipseState {
  semi_major_m: number;
  semi_minor_m: number;
  bearing_deg: number;
}

interface EstimateState {
  goals: GoalState[];
  reachable: number;
  basis: string;
}

interface FootprintCell {
  row: number;
  col: number;
  lat: number;
  lon: number;
  corners: number[][];
  counts: boolean;
  covered: number;
  p_tp: number;
  p_tn: number;
}

interface FootprintState {
  counts: boolean;
  covered: number;
  p_tp: number;
  p_tn: number;
  cells: FootprintCell[];
}

interface FoundState {
  lat: number;
  lon: number;
  probability: number;
  written: string;
  sigma_m: number;
  ellipse: EllipseState;
  thumbnail: string | null;
  confirmed: boolean;
}

interface GeometryState {
  type: string;
  coordinates: any[];
}

interface GoalState {
  pos: number;
  reached: boolean;
  seconds: number | null;
}

interface LinkState {
  up: boolean;
  silent_s: number | null;
  received: number | null;
  round_trip_s: number | null;
}

interface NewsState {
  id: string;
  role: string;
  words: string;
  lat: number;
  lon: number;
  cells: number;
  geometry: GeometryState | null;
}

interface NextState {
  words: string;
  name: string | null;
  distance_m: number | null;
  probability: number | null;
}

interface OptionState {
  action: string;
  region: number | null;
  visits: number;
  value: number | null;
  mass: number | null;
  distance_m: number | null;
  chosen: boolean;
  words: string;
}

interface PlaceState {
  lat: number;
  lon: number;
  probability: number;
  written: string;
}

interface PoseState {
  lat: number;
  lon: number;
  written: string;
  height_m: number;
  heading_deg: number | null;
  time: number;
  pitch_deg: number;
  roll_deg: number;
}

interface ReportsState {
  accepted: number;
  refused: number;
  refused_in_a_row: number;
  last_refusal: string | null;
  without_look: string | null;
  doubt: string | null;
  clock: string | null;
}

interface RunState {
  state:
    | "WAITING"
    | "READY"
    | "TAKEOFF"
    | "SEARCHING"
    | "CONFIRMING"
    | "FOUND"
    | "HOLDING"
    | "YIELDED"
    | "RETURNING"
    | "GROUNDED"
    | "DONE"
    | "ABORTED";
  words: string;
  why: string;
  orders: string[];
  next: NextState;
  choices: ChoiceState[];
  area: string;
  planner: string;
  time: number;
  speedup: number;
  pos: number;
  place: PlaceState;
  unseen: PlaceState[];
  suspects: SuspectState[];
  outside: number;
  steps: number;
  flight_time_s: number;
  sorties: SortieState[];
  news: NewsState[];
  flight_left_s: number | null;
  battery_percent: number | null;
  battery_doubt: string | null;
  battery: BatteryState | null;
  mode: string | null;
  reason: string;
  options: OptionState[];
  pose: PoseState | null;
  height_above_ground_m: number | null;
  wind: WindState | null;
  footprint: FootprintState;
  reports: ReportsState;
  link: LinkState | null;
  detector: DetectorState | null;
  ahead: [number, number][];
  regions: number[];
  drawn: DrawnState;
  found: FoundState | null;
  aircraft: AircraftState[];
  estimate?: EstimateState | null;
}

interface SortieState {
  number: number;
  aircraft: string;
  landed: number;
  flight_time_s: number;
  steps: number;
  pos: number;
  why: string;
  system_id: number | null;
  autopilot: string | null;
}

interface SuspectState {
  lat: number;
  lon: number;
  probability: number;
  thumbnail: string | null;
  hits: number;
  score: number | null;
  written: string;
}

interface WindState {
  speed_mps: number;
  from_deg: number;
}
