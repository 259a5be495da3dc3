// Looks up transitions in a one-hop table: one_hop.json and one_hop.bin of `segue export-engine`. Plain C#. In Unity,
// give both as text assets (rename the table to one_hop.bytes, so that it counts as binary):
//     new SegueOneHop(JsonUtility.FromJson<SegueOneHop.Header>(header.text), table.bytes)
using System;

public sealed class SegueOneHop {
    // Fields are called as the keys of the JSON are.
    [Serializable] public class Row {
        public int source, destination, first_trigger, triggers, first_entry;
    }

    [Serializable] public class Header {
        public float fps;
        public int blend_frames, entries;
        public string[] columns;
        public Row[] transitions;
    }

    public struct Entry {
        public int Hop; // the number of the clip to go through
        public int Offset; // the source's frame that coincides with the hop's frame 0
        public int StaySource, StayHop; // frames to stay before the first and before the second blend
        public int BlendFirst, BlendSecond; // frames of both blends
    }

    private readonly Header header;
    private readonly byte[] table;

    public SegueOneHop(Header header, byte[] table) {
        this.header = header;
        this.table = table;
        if (table.Length != 4 * header.entries * header.columns.Length) {
            throw new ArgumentException("expected " + header.entries + " entries, found " + table.Length + " bytes");
        }
    }

    // The best transition when it is asked for at a frame of the source; false where none fits in the clips.
    public bool TryLookUp(int source, int destination, int frame, out Entry entry) {
        entry = new Entry();
        foreach (Row row in header.transitions) {
            int trigger = frame - row.first_trigger;
            if (row.source == source && row.destination == destination && trigger >= 0 && trigger < row.triggers) {
                int width = header.columns.Length, at = width * (row.first_entry + trigger);
                entry.Hop = Number(at);
                entry.Offset = Number(at + 1);
                entry.StaySource = Number(at + 2);
                entry.StayHop = Number(at + 3);
                entry.BlendFirst = width > 4 ? Number(at + 4) : header.blend_frames;
                entry.BlendSecond = width > 4 ? Number(at + 5) : header.blend_frames;
                return entry.Hop >= 0;
            }
        }
        return false;
    }

    // Little-endian, on any processor.
    private int Number(int at) {
        return table[4 * at] | table[4 * at + 1] << 8 | table[4 * at + 2] << 16 | table[4 * at + 3] << 24;
    }
}
