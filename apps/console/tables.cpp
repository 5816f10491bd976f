#include "tables.hpp"

#include "theme.hpp"

#include <components/gui_client/track_store.hpp>

#include <ise/core/time_text.hpp>

#include <QHeaderView>
#include <QTableWidget>
#include <QVBoxLayout>

namespace atirma::console {

QTableWidget* make_table(const QStringList& heads, const QString& name, QWidget* parent) {
    auto* made = new QTableWidget(0, static_cast<int>(heads.size()), parent);
    made->setObjectName(name);
    made->setTabKeyNavigation(false); // Tab leaves the table; arrows move within it
    made->setHorizontalHeaderLabels(heads);
    made->horizontalHeader()->setStretchLastSection(true);
    made->horizontalHeader()->setDefaultAlignment(Qt::AlignLeft | Qt::AlignVCenter);
    made->verticalHeader()->hide();
    made->verticalHeader()->setDefaultSectionSize(24);
    made->setShowGrid(false);
    made->setAlternatingRowColors(true);
    made->setEditTriggers(QAbstractItemView::NoEditTriggers);
    made->setSelectionBehavior(QAbstractItemView::SelectRows);
    made->setSelectionMode(QAbstractItemView::SingleSelection);
    made->setWordWrap(false);
    made->setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff); // the tooltip shows truncated text
    return made;
}

bool set_cell(QTableWidget* table, int row, int column, const QString& words, const QColor& ink, const QString& tip) {
    auto* item = table->item(row, column);
    if (!item) table->setItem(row, column, item = new QTableWidgetItem);
    const bool changes = item->text() != words;
    item->setText(words);
    item->setForeground(ink);
    item->setToolTip(tip.isEmpty() ? words : tip);
    return changes;
}

QString clock_of(utc_time at) { return text(ise::iso_8601(at).substr(11, 8)); }

QVBoxLayout* column_of(QWidget* of) {
    auto* made = new QVBoxLayout(of);
    made->setContentsMargins(0, 2, 0, 0);
    made->setSpacing(5);
    return made;
}

} // namespace atirma::console
