// What a page knows of drives and their labels: every change is a step that can be undone, and is saved at once.

const PAUSE = 2000; // milliseconds between two looks at what others write

// `ask(path, sent)` -> JSON of the server, with `status`; `changed()` is called when something is to be shown anew,
// `told(text, choices)` when something is to be said: choices are [text, action]; what it returns takes that
// away again.
export function labelDesk(ask, changed, told) {
  const desk = { drives: [], places: [], now: 0, saving: 0, lost: false, round: 0, busy: false, said: "" };
  const done = [];
  const undone = [];

  desk.open = async () => {
    const state = await ask("state");
    desk.drives = state.drives;
    learnOf(state.places);
    for (const drive of desk.drives) learnOf(drive.stretches.map(([, , place]) => place));
    take(state);
    watch();
  };
  Object.defineProperty(desk, "drive", { get: () => desk.drives[desk.now] });

  function learnOf(names) {
    for (const name of names) if (!desk.places.includes(name)) desk.places.push(name);
  }
  desk.learnOf = learnOf;

  function take({ busy, said, round }) {
    Object.assign(desk, { busy, said, round });
  }

  // One step: what the stretches of some drives become, [[number, stretches], ...].
  desk.change = (changes) => {
    const real = changes.filter(([number, stretches]) => !same(stretches, desk.drives[number].stretches));
    if (!real.length) return false;
    done.push(real.map(([number]) => [number, desk.drives[number].stretches]));
    undone.length = 0;
    put(real);
    return true;
  };

  function put(changes) {
    for (const [number, stretches] of changes) {
      desk.drives[number].stretches = stretches;
      learnOf(stretches.map(([, , place]) => place));
      save(number);
    }
    changed();
  }

  function turn(from, to) {
    const changes = from.pop();
    if (!changes) return;
    to.push(changes.map(([number]) => [number, desk.drives[number].stretches]));
    put(changes);
  }
  desk.undo = () => turn(done, undone);
  desk.redo = () => turn(undone, done);
  desk.canUndo = () => done.length > 0;
  desk.canRedo = () => undone.length > 0;

  // One at a time for each drive: what comes meanwhile is saved next.
  async function save(number) {
    const drive = desk.drives[number];
    drive.waits = true;
    if (drive.saves || drive.conflict) return;
    drive.saves = true;
    desk.saving += 1;
    while (drive.waits && !drive.conflict) {
      drive.waits = false;
      await saveOnce(drive, number);
    }
    desk.saving -= 1;
    drive.saves = false;
    changed();
  }

  async function saveOnce(drive, number) {
    const sent = { version: drive.version, stretches: drive.stretches };
    try {
      const answer = await ask(`labels/${number}`, sent);
      drive.refused?.();
      drive.refused = null;
      if (answer.status === 200) drive.version = answer.version;
      else if (answer.status === 409) conflict(drive, number, answer);
      else drive.refused = told(`not saved: ${answer.error}`, [["try again", () => save(number)]]);
      desk.lost = false;
    } catch {
      desk.lost = true;
      drive.waits = true;
      changed();
      await new Promise((resolve) => setTimeout(resolve, PAUSE));
    }
  }

  // Nothing is lost either way: the other labels are one undo away.
  function conflict(drive, number, theirs) {
    drive.conflict = true;
    const decide = (keep) => () => {
      const mine = drive.stretches;
      drive.conflict = false;
      drive.version = theirs.version;
      drive.stretches = theirs.stretches;
      if (keep) desk.change([[number, mine]]) || save(number);
      else {
        drive.stretches = mine;
        adopt(drive, number, theirs);
      }
      changed();
    };
    told(`${theirs.error}.`, [["take that in", decide(false)], ["keep what is here", decide(true)]]);
  }

  function adopt(drive, number, { version, stretches }) {
    drive.version = version;
    if (same(stretches, drive.stretches)) return;
    done.push([[number, drive.stretches]]);
    undone.length = 0;
    drive.stretches = stretches;
    learnOf(stretches.map(([, , place]) => place));
    changed();
  }

  async function watch() {
    for (;;) {
      await new Promise((resolve) => setTimeout(resolve, desk.busy ? PAUSE / 4 : PAUSE));
      try {
        const before = `${desk.round} ${desk.busy} ${desk.said} ${desk.lost}`;
        const { versions, ...proposing } = await ask("versions");
        desk.lost = false;
        take(proposing);
        for (const [number, version] of versions.entries()) await lookAt(number, version);
        if (before !== `${desk.round} ${desk.busy} ${desk.said} ${desk.lost}`) changed();
      } catch {
        if (!desk.lost) {
          desk.lost = true;
          changed();
        }
      }
    }
  }

  async function lookAt(number, version) {
    const drive = desk.drives[number];
    const calm = () => !drive.saves && !drive.conflict;
    if (!calm() || version === drive.version) return;
    const theirs = await ask(`labels/${number}`);
    if (!calm() || theirs.version === drive.version) return;
    if (theirs.status !== 200) {
      told(theirs.error, []);
      return;
    }
    adopt(drive, number, theirs);
    told(`${drive.file} was changed by somebody else, and is read in; undo brings back what was here.`, []);
  }

  return desk;
}

function same(some, others) {
  return some.length === others.length && some.every((one, i) => one.every((value, k) => value === others[i][k]));
}
