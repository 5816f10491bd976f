#include "lists.hpp"

#include "tables.hpp"
#include "theme.hpp"

#include <components/gui_client/words.hpp>

#include <QHeaderView>
#include <QPlainTextEdit>
#include <QSplitter>
#include <QTableWidget>
#include <QVBoxLayout>

// The raw packet inspector.
namespace atirma::console {

packet_list::packet_list(QWidget* parent) : QWidget(parent) {
    table_ = make_table({tr("UTC"), tr("Kind"), tr("Link"), tr("Boot:seq"), tr("Bytes")}, "packet_table", this);
    table_->setAccessibleName(tr("Packets"));
    table_->setColumnWidth(0, 70);
    table_->setColumnWidth(1, 110);
    table_->setColumnWidth(2, 56);
    table_->setColumnWidth(3, 96);
    details_ = new QPlainTextEdit(this);
    details_->setObjectName("packet_details");
    details_->setReadOnly(true);
    details_->setTabChangesFocus(true);
    details_->setAccessibleName(tr("Fields and bytes of the packet"));
    details_->setLineWrapMode(QPlainTextEdit::NoWrap);
    details_->setPlaceholderText(tr("Select a packet to see its fields and bytes"));
    details_->setStyleSheet("font-family: 'DejaVu Sans Mono', monospace; font-size: 14px;");
    auto* split = new QSplitter(Qt::Vertical, this);
    split->addWidget(table_);
    split->addWidget(details_);
    split->setStretchFactor(0, 3);
    split->setStretchFactor(1, 4);
    column_of(this)->addWidget(split);
    connect(table_, &QTableWidget::itemSelectionChanged, this, &packet_list::inspect);
}

void packet_list::show_snapshot(const snapshot& seen) {
    if (shown_ == seen.packets || !isVisible()) return;
    shown_ = seen.packets;
    const auto& t = colours();
    QSignalBlocker quiet(table_);
    table_->setRowCount(static_cast<int>(shown_->size()));
    int row = 0, chosen_row = -1;
    for (auto it = shown_->rbegin(); it != shown_->rend(); ++it, ++row) {
        const auto& one = **it;
        auto message = parse_telemetry(one.packet.raw);
        auto kind = message ? text(std::string(name_of(message->body))).replace('_', ' ') : tr("malformed");
        if (one.packet.history) kind += tr(" (history)");
        if (one.duplicate) kind += tr(" (again)");
        set_cell(table_, row, 0, clock_of(one.arrived_at), t.ink3);
        set_cell(table_, row, 1, kind, !message ? t.bad : one.duplicate ? t.ink3 : t.ink);
        set_cell(table_, row, 2, text(label(one.packet.link)), t.of(one.packet.link), text(one.path));
        set_cell(table_, row, 3, QStringLiteral("%1:%2").arg(one.packet.boot).arg(one.packet.sequence), t.ink2);
        set_cell(table_, row, 4, QString::number(one.packet.raw.size()), t.ink2);
        if (one.number == chosen_) chosen_row = row;
    }
    if (chosen_row >= 0) table_->selectRow(chosen_row);
    else table_->clearSelection();
}

void packet_list::inspect() {
    auto rows = table_->selectionModel()->selectedRows();
    if (rows.isEmpty() || !shown_) return;
    auto place = static_cast<std::size_t>(rows.front().row());
    if (place >= shown_->size()) return;
    const auto& one = *(*shown_)[shown_->size() - 1 - place];
    chosen_ = one.number;
    auto info = describe(one.packet);
    QString all = text(info.kind) + tr("   by %1\n\n").arg(text(one.path));
    for (const auto& field : info.fields) all += text(field.name).leftJustified(24) + text(field.value) + '\n';
    details_->setPlainText(all + '\n' + text(hex_dump(one.packet.raw)));
}

} // namespace atirma::console
