// Writes the .vdb and .blosc files of this folder, and expected.txt with what OpenVDB itself reads from them. See README.md.

#include <blosc.h>
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include <cinttypes>
#include <cstdio>
#include <fstream>
#include <string>

using namespace openvdb;

static std::FILE* expected;

// A number in [0, 1) from integers.
static double noise(int64_t x, int64_t y, int64_t z)
{
    uint64_t h = uint64_t(x) * 0x9e3779b97f4a7c15u ^ uint64_t(y) * 0xc2b2ae3d27d4eb4fu ^ uint64_t(z) * 0x165667b19e3779f9u;
    h = (h ^ (h >> 31)) * 0xd6e8feb86659fd93u;
    return double((h ^ (h >> 32)) >> 40) / double(1 << 24);
}

// A ball that is denser within, with noise that does not compress well when `rough`.
template<typename GridT>
static typename GridT::Ptr ball(const Coord& centre, int radius, bool rough, const std::string& name = "density")
{
    auto grid = GridT::create(0);
    grid->setName(name);
    grid->setGridClass(GRID_FOG_VOLUME);
    auto accessor = grid->getAccessor();
    for (int x = -radius; x <= radius; ++x)
        for (int y = -radius; y <= radius; ++y)
            for (int z = -radius; z <= radius; ++z) {
                const double d = std::sqrt(double(x * x + y * y + z * z)) / radius;
                if (d >= 1) continue;
                const double step = rough ? noise(x, y, z) : std::floor(4 * d) / 4;
                accessor.setValue(centre + Coord(x, y, z), typename GridT::ValueType(1.25 - d + step));
            }
    return grid;
}

template<typename GridT>
static void expect(const std::string& file, const std::string& name, const GridT& grid)
{
    const auto& tree = grid.tree();
    CoordBBox box;
    uint64_t hash = 0;
    const auto add = [&](const CoordBBox& place) {
        box.expand(place);
        for (auto p = place.begin(); p; ++p) {
            const float value = float(tree.getValue(*p));
            if (value == 0) continue;
            uint32_t bits;
            std::memcpy(&bits, &value, 4);
            uint64_t h = bits;
            for (int axis = 0; axis < 3; ++axis) h = (h ^ uint32_t((*p)[axis])) * 0x9e3779b97f4a7c15u;
            hash += h ^ (h >> 32);
        }
    };
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) add(leaf->getNodeBoundingBox());
    auto tile = tree.cbeginValueAll();
    tile.setMaxDepth(2);
    for (; tile; ++tile)
        if (tile.getValue() != 0) add(tile.getBoundingBox());

    const auto [l, h] = std::make_pair(box.min(), box.max());
    std::fprintf(expected, "grid %s %s\n", file.c_str(), name.c_str());
    std::fprintf(expected, "box %d %d %d %d %d %d\n", l[0], l[1], l[2], h[0], h[1], h[2]);
    std::fprintf(expected, "hash %" PRIu64 "\n", hash);
    for (const Coord c : {Coord(0, 0, 0), l, h, Coord(3, -7, 11)}) {
        const Vec3d w = grid.transform().indexToWorld(c);
        std::fprintf(expected, "world %d %d %d %.17g %.17g %.17g\n", c[0], c[1], c[2], w[0], w[1], w[2]);
    }
    for (int i = 0; i < 24; ++i) {
        Coord c;
        for (int axis = 0; axis < 3; ++axis) c[axis] = l[axis] - 2 + int(noise(i, axis, 7) * (h[axis] - l[axis] + 5));
        // Some where there is something.
        if (i % 2) {
            auto voxel = tree.cbeginValueOn();
            for (int skip = 0; voxel && skip < i * 17; ++skip) ++voxel;
            if (voxel) c = voxel.getCoord();
        }
        std::fprintf(expected, "value %d %d %d %.9g\n", c[0], c[1], c[2], float(tree.getValue(c)));
    }
}

static void write(const std::string& name, uint32_t compression, const GridCPtrVec& grids)
{
    io::File file(name + ".vdb");
    file.setCompression(compression);
    file.write(grids);
    file.close();
}

// The grid as OpenVDB reads it back: values may have been rounded to halves.
template<typename GridT>
static void expectFile(const std::string& name, const std::string& grid = "density")
{
    io::File file(name + ".vdb");
    file.open();
    expect(name, grid, *gridPtrCast<GridT>(file.readGrid(grid)));
    file.close();
}

template<typename GridT>
static void writeOne(const std::string& name, uint32_t compression, const typename GridT::Ptr& grid)
{
    write(name, compression, {grid});
    expectFile<GridT>(name);
}

// The transform with just this kind of map, which only a file gives: OpenVDB's constructors choose among some kinds.
static math::Transform::Ptr exactly(const math::MapBase& map)
{
    std::stringstream stream;
    io::setCurrentVersion(stream);
    writeString(stream, map.type());
    map.write(stream);
    auto transform = math::Transform::createLinearTransform();
    transform->read(stream);
    return transform;
}

// Leaves whose inactive values are of every kind that the format tells apart.
static FloatGrid::Ptr inactive()
{
    auto grid = ball<FloatGrid>(Coord(4), 3, true);
    for (int kind = 1; kind < 5; ++kind) {
        const Coord origin(8 * kind, 0, 0);
        for (int i = 0; i < 512; ++i) {
            const Coord c = origin + Coord(i >> 6, i >> 3 & 7, i & 7);
            if (i % 3 == 0) {
                grid->tree().setValueOn(c, float(i) / 8);
                continue;
            }
            const int pick = int(noise(i, kind, 5) * 8);
            const float values[4] = {
                0.25f, pick < 3 ? 0.5f : 0.0f, pick < 3 ? 0.75f : 1.5f, float(pick) / 16};
            grid->tree().setValueOff(c, values[kind - 1]);
        }
    }
    return grid;
}

// Chunks of floats, i modulo 37 and at the end noise, as other settings and other versions of Blosc would have written them.
static void chunk(const std::string& name, int splitMode, size_t block, int shuffle, const char* codec, int level,
    int count = 701)
{
    std::vector<float> values(count);
    for (int i = 0; i < count; ++i) values[i] = i < count - 101 ? float(i % 37) : float(noise(i, 0, 0));
    std::vector<char> out(4 * count + BLOSC_MAX_OVERHEAD);
    blosc_set_splitmode(splitMode);
    const int size =
        blosc_compress_ctx(level, shuffle, 4, 4 * count, values.data(), out.data(), out.size(), codec, block, 1);
    std::ofstream(name + ".blosc", std::ios::binary).write(out.data(), size);
}

int main()
{
    chunk("whole", BLOSC_NEVER_SPLIT, 4 * 701, 1, "lz4", 9);
    chunk("split", BLOSC_ALWAYS_SPLIT, 4 * 701, 1, "lz4", 9);
    chunk("blocks", BLOSC_NEVER_SPLIT, 256, 1, "lz4", 9);
    chunk("split_blocks", BLOSC_ALWAYS_SPLIT, 1024, 1, "lz4", 9, 20001);
    chunk("unshuffled", BLOSC_NEVER_SPLIT, 1000, 0, "lz4", 9);
    chunk("copied", BLOSC_NEVER_SPLIT, 1000, 1, "lz4", 0);
    chunk("bits", BLOSC_NEVER_SPLIT, 1024, 2, "lz4", 9);
    chunk("zlib", BLOSC_NEVER_SPLIT, 1024, 1, "zlib", 9);
    chunk("blosclz", BLOSC_NEVER_SPLIT, 1024, 1, "blosclz", 9);
    initialize();
    using namespace io;
    expected = std::fopen("expected.txt", "w");

    auto grid = ball<FloatGrid>(Coord(13, 15, 21), 8, true);
    grid->setTransform(math::Transform::createLinearTransform(0.25));
    writeOne<FloatGrid>("blosc", COMPRESS_BLOSC | COMPRESS_ACTIVE_MASK, grid);

    grid = ball<FloatGrid>(Coord(12), 5, false);
    auto scale = math::Mat4d::identity();
    scale.setToScale(Vec3d(0.5, 2, 0.125));
    grid->setTransform(math::Transform::createLinearTransform(scale));
    writeOne<FloatGrid>("blosc_unmasked", COMPRESS_BLOSC, grid);

    // OpenVDB does not zip fog volumes.
    grid = ball<FloatGrid>(Coord(-40, 12, 10), 8, false);
    grid->setGridClass(GRID_UNKNOWN);
    grid->setTransform(exactly(math::TranslationMap(Vec3d(1.5, -2.25, 1e3))));
    writeOne<FloatGrid>("zip", COMPRESS_ZIP | COMPRESS_ACTIVE_MASK, grid);
    grid = ball<FloatGrid>(Coord(12), 6, true);
    grid->setGridClass(GRID_UNKNOWN);
    grid->insertMeta("a note", StringMetadata("with metadata of several types"));
    grid->insertMeta("a number", FloatMetadata(3));
    grid->insertMeta("a vector", Vec3DMetadata(Vec3d(1, 2, 3)));
    writeOne<FloatGrid>("zip_unmasked", COMPRESS_ZIP, grid);

    grid = ball<FloatGrid>(Coord(1000, 20, -17), 6, true);
    grid->setTransform(math::Transform::createLinearTransform(0.1));
    grid->transform().postTranslate(Vec3d(10, 20.5, -30));
    writeOne<FloatGrid>("uncompressed", COMPRESS_ACTIVE_MASK, grid);

    grid = ball<FloatGrid>(Coord(10, 9, 8), 7, true);
    grid->setSaveFloatAsHalf(true);
    grid->setTransform(exactly(math::ScaleTranslateMap(Vec3d(0.5, 0.25, 3), Vec3d(-1, -2, -4))));
    writeOne<FloatGrid>("half", COMPRESS_BLOSC | COMPRESS_ACTIVE_MASK, grid);
    grid = ball<FloatGrid>(Coord(8, 8, 8), 5, true);
    grid->setGridClass(GRID_UNKNOWN);
    grid->setSaveFloatAsHalf(true);
    writeOne<FloatGrid>("half_zip", COMPRESS_ZIP | COMPRESS_ACTIVE_MASK, grid);

    writeOne<DoubleGrid>("double", COMPRESS_BLOSC | COMPRESS_ACTIVE_MASK, ball<DoubleGrid>(Coord(8), 5, true));
    auto doubles = ball<DoubleGrid>(Coord(8), 4, true);
    doubles->setSaveFloatAsHalf(true);
    writeOne<DoubleGrid>("double_half", COMPRESS_ACTIVE_MASK, doubles);

    grid = ball<FloatGrid>(Coord(-3000, 9, 9), 6, false);
    grid->tree().merge(ball<FloatGrid>(Coord(5001, 4104, -9), 5, true)->tree());
    writeOne<FloatGrid>("sparse", COMPRESS_BLOSC | COMPRESS_ACTIVE_MASK, grid);

    grid = ball<FloatGrid>(Coord(-4, -4, -4), 3, true);
    grid->tree().addTile(1, Coord(-24, 16, 8), 0.5f, true);
    grid->tree().addTile(1, Coord(40, 16, 8), 0.75f, false);
    grid->tree().addTile(1, Coord(-640, 16, 8), 0.0f, true);
    grid->tree().addTile(2, Coord(-256, 128, 0), 2.0f, true);
    grid->setTransform(exactly(math::UnitaryMap(Vec3d(1, 2, 3), 0.7)));
    writeOne<FloatGrid>("tiles", COMPRESS_BLOSC | COMPRESS_ACTIVE_MASK, grid);

    grid = ball<FloatGrid>(Coord(7, 8, 9), 5, true);
    grid->setTransform(math::Transform::createLinearTransform(0.3));
    grid->transform().postRotate(0.4, math::Y_AXIS);
    grid->transform().postShear(0.2, math::X_AXIS, math::Z_AXIS);
    grid->transform().postScale(Vec3d(1, -2, 3));
    grid->transform().postTranslate(Vec3d(7, -8, 9.5));
    writeOne<FloatGrid>("affine", COMPRESS_BLOSC | COMPRESS_ACTIVE_MASK, grid);

    grid = inactive();
    grid->setGridClass(GRID_UNKNOWN);
    writeOne<FloatGrid>("inactive", COMPRESS_ZIP | COMPRESS_ACTIVE_MASK, grid);
    grid->setSaveFloatAsHalf(true);
    writeOne<FloatGrid>("inactive_half", COMPRESS_BLOSC | COMPRESS_ACTIVE_MASK, grid);

    {
        auto density = ball<FloatGrid>(Coord(5), 3, true);
        auto heat = ball<FloatGrid>(Coord(6), 3, true, "heat");
        auto again = ball<FloatGrid>(Coord(7), 3, true, "heat");
        auto shared = FloatGrid::create(density->treePtr());
        shared->setName("shared");
        shared->setGridClass(GRID_FOG_VOLUME);
        shared->setTransform(math::Transform::createLinearTransform(5));
        auto wind = Vec3SGrid::create(Vec3s(0));
        wind->setName("wind");
        auto id = Int32Grid::create(0);
        id->setName("id");
        write("several", COMPRESS_BLOSC | COMPRESS_ACTIVE_MASK, {wind, heat, density, again, shared, id});
        expectFile<FloatGrid>("several");
        expectFile<FloatGrid>("several", "shared");
        // OpenVDB's `readGrid` takes the first of several of one name.
        expect("several", "heat[0]", *heat);
        expect("several", "heat[1]", *again);
        write("only_heat", COMPRESS_BLOSC | COMPRESS_ACTIVE_MASK, {wind, heat});
        expectFile<FloatGrid>("only_heat", "heat");
        write("no_floats", COMPRESS_BLOSC | COMPRESS_ACTIVE_MASK, {wind, id});
    }

    // Grids that cannot be used as densities.
    {
        GridCPtrVec grids;
        const auto add = [&](const char* name, float background = 0) {
            auto grid = FloatGrid::create(background);
            grid->setName(name);
            grids.push_back(grid);
            return grid;
        };
        add("empty");
        add("level set")->setGridClass(GRID_LEVEL_SET);
        add("background", 0.5f);
        add("frustum")->setTransform(
            math::Transform::createFrustumTransform(BBoxd(Vec3d(0), Vec3d(100)), 0.5, 10, 0.1));
        add("root tile")->tree().addTile(3, Coord(8192, 0, 0), 1.0f, true);
        auto tiles = add("many tiles");
        for (int i = 0; i < 1000; ++i)
            tiles->tree().addTile(2, Coord(0, 4096 + 128 * (i / 32), 128 * (i % 32)), 1.0f, true);
        write("unusable", COMPRESS_BLOSC | COMPRESS_ACTIVE_MASK, grids);
    }
    std::ofstream stream("stream.vdb", std::ios::binary);
    io::Stream(stream).write({FloatGrid::create(0)});

    std::fclose(expected);
}
