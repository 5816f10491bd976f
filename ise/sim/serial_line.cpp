#include <ise/sim/serial_line.hpp>

#include <ise/sim/stream_end.hpp>

#include <fmt/format.h>

namespace ise::sim {

class serial_end final : public stream_end {
public:
    serial_end(serial_line& line, std::size_t side, socket_owner& owner, loop& on, std::string peer)
        : stream_end(owner, on, serial_line::receive_buffer_bytes, std::move(peer)), line_(line), side_(side) {}

private:
    std::size_t send_room() const override {
        const auto used = line_.under_way_[side_];
        return used >= serial_line::send_buffer_bytes ? 0 : serial_line::send_buffer_bytes - used;
    }
    void send(bytes_view content) override { line_.carry(side_, content); }
    void finish() override {}
    void let_go() override {}
    void lost(ending) override {}

    serial_line& line_;
    std::size_t side_;
};

namespace {
constexpr std::size_t piece_bytes = 32; // what a UART hands over at once
}

serial_line& serial_line::into(world_core& world, machine& host, const std::string& name) {
    auto& found = host.serial_lines[name];
    if (!found) found = host.serial_lines["/dev/" + name] = std::make_shared<serial_line>(world, host, name);
    return *found;
}

serial_line::serial_line(world_core& world, const machine& into, const std::string& name)
    : world_(world), name_(into.name() + " " + name), random_(world.seed(), "serial " + into.name() + " " + name) {}
serial_line::~serial_line() = default;

result<std::unique_ptr<stream>> serial_line::open_far_end(socket_owner& owner, loop& on) {
    auto open = ends_[far].lock();
    if (open && !open->gone()) return failure(errc::io_failed, fmt::format("the far end of {} is open already", name_));
    auto end = std::make_shared<serial_end>(*this, far, owner, on, "serial far end " + name_);
    ends_[far] = end;
    owner.attach(end);
    return make_stream(std::move(end));
}

result<std::unique_ptr<stream>> serial_line::open_device(socket_owner& owner, loop& on, const std::string& path,
                                                         unsigned baud) {
    if (!present_)
        return failure(errc::io_failed, fmt::format("cannot open {}: no such device; is it plugged in?", path));
    auto open = ends_[device].lock();
    if (open && !open->gone()) return failure(errc::io_failed, fmt::format("cannot open {}: it is in use", path));
    baud_ = baud;
    auto end = std::make_shared<serial_end>(*this, device, owner, on, "serial " + path);
    ends_[device] = end;
    owner.attach(end);
    return make_stream(std::move(end));
}

void serial_line::vanish() {
    present_ = false;
    world_.note("vanish", name_);
    if (auto open = ends_[device].lock()) open->fail(std::make_error_code(std::errc::no_such_device));
    ends_[device].reset();
}

void serial_line::carry(std::size_t from, bytes_view content) {
    under_way_[from] += content.size();
    while (!content.empty()) {
        auto part = content.first(std::min(piece_bytes, content.size()));
        content = content.subspan(part.size());
        free_at_[from] = std::max(free_at_[from], world_.now()) +
                         duration(static_cast<duration::rep>(part.size() * 10'000'000'000ull / baud_));
        world_.engine().at(free_at_[from], nullptr, [this, from, part = bytes(part.begin(), part.end())]() mutable {
            const auto size = part.size();
            const bool was_full = under_way_[from] >= send_buffer_bytes;
            under_way_[from] -= size;
            arrive(1 - from, std::move(part));
            auto source = ends_[from].lock();
            if (source && (was_full || under_way_[from] <= send_buffer_bytes / 2)) source->wake_writer();
        });
    }
}

void serial_line::arrive(std::size_t to, bytes content) {
    auto target = ends_[to].lock();
    if (!present_ || !target || target->gone()) {
        world_.note("drop", name_, content.size());
        return;
    }
    if (far_end_baud != 0 && far_end_baud != baud_)
        for (auto& each : content) each ^= static_cast<std::byte>(1 + random_.below(255));
    const auto taken = target->receive(content);
    world_.note("serial", name_, taken);
    if (taken < content.size()) world_.note("overrun", name_, content.size() - taken);
}

} // namespace ise::sim
