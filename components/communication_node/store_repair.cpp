#include <components/communication_node/store_repair.hpp>

#include <components/communication_node/store_check.hpp>

#include <fmt/format.h>

#include <functional>

namespace atirma {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t repair_page = 256;
constexpr ise::duration between_pages = 1ms; // the loop serves others meanwhile
constexpr ise::duration disk_again = 1s;

/// Completes when the disk has accepted them.
ise::task<> until_kept(ise::component& self, const std::function<bool()>& restore) {
    bool kept = restore();
    while (!kept) {
        co_await self.sleep(disk_again);
        kept = restore();
    }
    co_await self.sleep(between_pages);
}

} // namespace

ise::task<> restore_intact(std::string file, node_context& here, store_keeper& store, kept_telemetry& telemetry,
                           node_authority& authority, node_telecommands& telecommands) {
    auto opened = store_reader::open(file);
    if (opened) {
        auto& reader = *opened;
        auto held = reader.authority();
        authority.restore(held.first, held.second);
        auto records = reader.next_commands(repair_page);
        std::function<bool()> restore_records = [&] { return telecommands.restore(records); };
        for (; !records.empty(); records = reader.next_commands(repair_page))
            co_await until_kept(here.self, restore_records);
        auto packets = reader.next_packets(repair_page);
        std::function<bool()> restore_packets = [&] { return telemetry.restore(packets); };
        for (; !packets.empty(); packets = reader.next_packets(repair_page))
            co_await until_kept(here.self, restore_packets);
        const auto& found = reader.found();
        auto outcome = fmt::format("{} packets and {} telecommands of it were sound; {} and {} were not, and {} parts "
                                   "could not be read",
                                   found.packets, found.telecommands, found.damaged_packets, found.damaged_telecommands,
                                   found.unreadable.size());
        here.self.log().warning("the intact rows of the damaged store are restored",
                                {{"file", file}, {"found", outcome}});
        store.restored(outcome);
    } else {
        here.self.log().error("nothing can be read of the store that was set aside",
                              {{"cause", opened.error().message()}});
        store.restored("nothing of it can be read");
    }
}

} // namespace atirma
