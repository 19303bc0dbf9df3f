// What the page is told and what it keeps. What `/api/state` says is in state.d.ts, which is written from the service.

// The map library, as it is shipped with the page; it has no types of its own.
declare const L: any;

interface Window {
  L: any;
}

/** Degrees: latitude, longitude. */
type Place = [number, number];
type Colour = [number, number, number];

type Growing = "hits" | "curve";
/** What a moment may change. */
type Changing = Growing | "belief" | "pod";

type LayerName =
  | "belief"
  | "pod"
  | "regions"
  | "names"
  | "track"
  | "footprint"
  | "ahead"
  | "hits"
  | "area"
  | "news"
  | "tiles";

/** The grid: corners north-west first, clockwise. */
interface Frame {
  rows: number;
  cols: number;
  cell_m: number;
  bearing_deg: number;
  corners: Place[];
}

interface Feature {
  type: "Feature";
  geometry: unknown;
  properties: any;
}

interface FeatureCollection {
  type: "FeatureCollection";
  features: Feature[];
}

/** Where the ground map's tiles are; `own`: they are the service's. */
interface Tiles {
  url: string;
  attribution: string;
  min_zoom: number;
  max_zoom: number;
  own: boolean;
}

/** What hardly changes during a run: the first message. `replay`: its first and last time. */
interface Scene {
  type: "scene";
  area: string;
  about: string;
  planner: string;
  frame: Frame;
  features: FeatureCollection;
  regions: FeatureCollection;
  /** What people call the regions. */
  names: string[];
  /** How often the regions were drawn again. */
  drawn: number;
  /** Names of the area file, and where they belong. */
  places: { name: string; role: string; lat: number; lon: number }[];
  /** What people call the parts of the area file's prior. */
  priors: string[];
  /** How the team writes places. */
  coordinates: string;
  outside: number;
  notes: string[];
  tiles?: Tiles | null;
  replay?: [number, number] | null;
  /** Whether the token gives no orders. */
  read_only: boolean;
}

/** The regions, whenever they have been drawn again. */
interface Drawn {
  type: "regions";
  regions: FeatureCollection;
  names: string[];
  drawn: number;
}

/** What is new of an array of bytes, in base64: all of it, or the bytes at some places. */
interface BytesNews {
  codes?: string;
  at?: string;
}

/** What is new of a list: cut it at `from`, and append. */
interface RowsNews {
  from: number;
  rows: Place[];
}

/** What has happened since the last message. */
interface Moment {
  type: "moment";
  state: RunState;
  belief: BytesNews & { reference: number; log2_total: number };
  pod: BytesNews;
  /** Of the only aircraft. */
  track?: RowsNews;
  /** Of several, in the order of the state's `aircraft`. */
  tracks?: (RowsNews | null)[];
  hits?: RowsNews;
  curve?: RowsNews;
}

/** What a person looks at, and which layers they have switched off. */
interface View {
  centre: Place;
  zoom: number;
  hidden: string[];
  shows?: "belief" | "pod";
}
